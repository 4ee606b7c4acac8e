//! The `direct` model's tensors in an avatar file.

use safetensors::tensor::Dtype;

use super::tables::{DirectTables, table_lengths};
use crate::file::{AvatarFileError, Reader, Tensors};
use crate::template::{AvatarConfig, Template};

impl DirectTables {
    /// Adds the tables to the tensors of a file. This was the first model, so its tensors have no prefix.
    pub(crate) fn write(&self, template: &Template, config: &AvatarConfig, out: &mut Tensors) {
        let count = template.len();
        let joints = template.joint_count();
        let channels = config.channels();
        out.add("shape_basis", Dtype::F32, &[config.shape_bases, 3, count], &self.shape_basis);
        if !config.plain_skinning {
            out.add("residual_weights", Dtype::F32, &[joints, count], &self.residual_weights);
            out.add("skeleton_regressor", Dtype::F32, &[joints, count], &self.regressor);
        }
        out.add("appearance", Dtype::F32, &[self.appearance.len() / count.max(1), count], &self.appearance);
        out.add("response_bias", Dtype::F32, &[channels], &self.response[..channels]);
        out.add("response_gain", Dtype::F32, &[channels, joints, 9], &self.response[channels..]);
        out.add("response_limits", Dtype::F32, &[channels, joints, 2], &self.response_limits);
    }

    /// Reads the tables from the tensors of a file and checks them.
    pub(crate) fn read(
        reader: &Reader<'_>,
        template: &Template,
        config: &AvatarConfig,
    ) -> Result<DirectTables, AvatarFileError> {
        let count = template.len();
        let joints = template.joint_count();
        let channels = config.channels();
        let bias = reader.floats("response_bias", &[Some(channels)])?;
        let gain = reader.floats("response_gain", &[Some(channels), Some(joints), Some(9)])?;
        let response_limits = reader.floats("response_limits", &[Some(channels), Some(joints), Some(2)])?;
        if let Some(i) = response_limits.as_chunks::<2>().0.iter().position(|[low, high]| low > high) {
            let channel = i / joints;
            let joint = i % joints;
            let problem = format!("channel {channel}, joint {joint}: the lower limit is above the upper one");
            return Err(reader.invalid("response_limits", format!("{problem}; train the avatar again")));
        }
        let appearance_rows = table_lengths(count, joints, config)[3] / count;
        let residual = |name: &str| match config.plain_skinning {
            true => Ok(vec![]),
            false => reader.floats(name, &[Some(joints), Some(count)]),
        };
        Ok(DirectTables {
            shape_basis: reader.floats("shape_basis", &[Some(config.shape_bases), Some(3), Some(count)])?,
            residual_weights: residual("residual_weights")?,
            regressor: residual("skeleton_regressor")?,
            appearance: reader.floats("appearance", &[Some(appearance_rows), Some(count)])?,
            response: [bias, gain].concat(),
            response_limits,
        })
    }
}
