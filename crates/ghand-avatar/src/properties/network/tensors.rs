//! The `network` model's tensors in an avatar file.

use crate::deform::PropertySizes;
use safetensors::tensor::Dtype;

use super::networks::Networks;
use super::sizes::{NetworkSizes, Normalization};
use super::tables::{LOGIT_ROWS, NetworkTables, property_sizes};
use crate::file::{AvatarFileError, Reader, Tensors};
use crate::template::{AvatarConfig, Template};

impl NetworkTables {
    /// Adds the tables to the tensors of a file. Linear layers are `[inputs][outputs]`, convolutions
    /// `[outputs][inputs][4][4]`, transposed ones `[inputs][outputs][4][4]`.
    pub(crate) fn write(&self, out: &mut Tensors) {
        let PropertySizes { gaussians, bases, .. } = self.properties;
        let (_, list) = Networks::new(&self.sizes, self.properties);
        for (parameter, values) in list.parameters.iter().zip(&self.parameters) {
            out.add(&format!("network.{}", parameter.name), Dtype::F32, &parameter.shape, values);
        }
        for (k, norms) in self.running_norms.iter().enumerate() {
            for (what, values) in ["mean", "variance"].into_iter().zip(norms) {
                out.add(&format!("network.norm.{k}.{what}"), Dtype::F32, &[values.len()], values);
            }
        }
        out.add("network.base_shape_basis", Dtype::F32, &[bases, 3, gaussians], &self.base_shape_basis);
        out.add("network.base_logits", Dtype::F32, &[LOGIT_ROWS, gaussians], &self.base_logits);
    }

    /// Reads the tables from the tensors of a file and checks them.
    pub(crate) fn read(
        reader: &Reader<'_>,
        template: &Template,
        config: &AvatarConfig,
        sizes: &NetworkSizes,
    ) -> Result<NetworkTables, AvatarFileError> {
        sizes.check().map_err(|problem| reader.invalid("config", format!("network: {problem}")))?;
        let properties = property_sizes(template, config);
        let (_, list) = Networks::new(sizes, properties);
        let floats = |name: &str, shape: &[usize]| {
            let shape: Vec<Option<usize>> = shape.iter().copied().map(Some).collect();
            reader.floats(&format!("network.{name}"), &shape)
        };
        let parameters: Result<_, _> = list.parameters.iter().map(|p| floats(&p.name, &p.shape)).collect();
        let mut running_norms = Vec::new();
        if sizes.normalization == Normalization::Batch {
            for (k, channels) in list.norms.iter().enumerate() {
                let variance = format!("norm.{k}.variance");
                let norms = [floats(&format!("norm.{k}.mean"), &[*channels])?, floats(&variance, &[*channels])?];
                if norms[1].iter().any(|v| *v < 0.0) {
                    let problem = "has a negative number; train the avatar again";
                    return Err(reader.invalid(&format!("network.{variance}"), problem));
                }
                running_norms.push(norms);
            }
        }
        Ok(NetworkTables {
            sizes: sizes.clone(),
            properties,
            parameters: parameters?,
            running_norms,
            base_shape_basis: floats("base_shape_basis", &[properties.bases, 3, properties.gaussians])?,
            base_logits: floats("base_logits", &[LOGIT_ROWS, properties.gaussians])?,
        })
    }
}
