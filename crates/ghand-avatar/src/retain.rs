//! An avatar with a part of its Gaussians.

use crate::avatar::Avatar;
use crate::light::AvatarLight;
use crate::properties::PropertyTables;
use crate::properties::direct::DirectTables;
use crate::template::Template;

impl Avatar {
    /// The avatar with only the Gaussians for which `mask`, N, is true. `None` unless it is a `direct` one: networks
    /// compute all texels together, and baked tables are in groups.
    pub fn retain(&self, mask: &[bool]) -> Option<Avatar> {
        let PropertyTables::Direct(tables) = &self.tables else { return None };
        let template = Template {
            rest: columns(&self.template.rest, mask),
            weights: columns(&self.template.weights, mask),
            spacings: columns(&self.template.spacings, mask),
            normals: self.template.normals.as_ref().map(|normals| columns(normals, mask)),
            ..self.template.clone()
        };
        let tables = DirectTables {
            shape_basis: columns(&tables.shape_basis, mask),
            residual_weights: columns(&tables.residual_weights, mask),
            regressor: columns(&tables.regressor, mask),
            appearance: columns(&tables.appearance, mask),
            ..tables.clone()
        };
        let light = self.light.as_ref().map(|light| AvatarLight {
            faces: columns(&light.faces, mask),
            barycentric: columns(&light.barycentric, mask),
            ..light.clone()
        });
        let seen = self.seen.as_ref().map(|seen| columns(seen, mask));
        Some(Avatar { template, tables: PropertyTables::Direct(tables), light, seen, ..self.clone() })
    }
}

/// The columns of a table `[rows][N]` for which the mask is true.
fn columns<T: Copy>(table: &[T], mask: &[bool]) -> Vec<T> {
    table.iter().zip(mask.iter().cycle()).filter(|(_, retained)| **retained).map(|(value, _)| *value).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;
    use crate::light::Light;
    #[cfg(feature = "networks")]
    use crate::properties::network::NetworkSizes;
    use crate::template::{AvatarConfig, GaussianShape};

    #[test]
    fn all_that_belongs_to_a_gaussian_is_kept_or_dropped_with_it() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let config = AvatarConfig { uv_resolution: 16, gaussians: GaussianShape::Flat, ..Default::default() };
        let mut avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap();
        let samples = ghand_hand_model::surface::sample_surface(&model, 16).unwrap();
        avatar.light = Some(AvatarLight::new(Light::studio(), None, &samples));
        let count = avatar.template.len();
        avatar.seen = Some((0..count).map(|p| p as f32).collect());
        assert_eq!(avatar.retain(&vec![true; count]).as_ref(), Some(&avatar));
        let kept: Vec<bool> = (0..count).map(|p| p % 3 != 1).collect();
        let part = avatar.retain(&kept).unwrap();
        let left: Vec<usize> = (0..count).filter(|p| p % 3 != 1).collect();
        assert_eq!(part.template.len(), left.len());
        let (PropertyTables::Direct(tables), PropertyTables::Direct(before)) = (&part.tables, &avatar.tables) else {
            unreachable!()
        };
        let row = |table: &[f32], row: usize, columns: usize| table[row * columns..(row + 1) * columns].to_vec();
        for (table, whole) in [
            (&part.template.rest, &avatar.template.rest),
            (&part.template.weights, &avatar.template.weights),
            (part.template.normals.as_ref().unwrap(), avatar.template.normals.as_ref().unwrap()),
            (&tables.shape_basis, &before.shape_basis),
            (&tables.residual_weights, &before.residual_weights),
            (&tables.regressor, &before.regressor),
            (&tables.appearance, &before.appearance),
        ] {
            assert_eq!(table.len() * count, whole.len() * left.len());
            let last = whole.len() / count - 1;
            let whole = row(whole, last, count);
            assert_eq!(row(table, last, left.len()), left.iter().map(|p| whole[*p]).collect::<Vec<_>>());
        }
        assert_eq!(tables.response, before.response);
        assert_eq!(part.seen.unwrap(), left.iter().map(|p| *p as f32).collect::<Vec<_>>());
        let light = part.light.unwrap();
        let whole = avatar.light.unwrap();
        assert_eq!(light.faces, left.iter().map(|p| whole.faces[*p]).collect::<Vec<_>>());
        assert_eq!(light.barycentric, left.iter().map(|p| whole.barycentric[*p]).collect::<Vec<_>>());
    }

    #[cfg(feature = "networks")]
    #[test]
    fn networks_keep_all_their_gaussians() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let config = AvatarConfig { uv_resolution: 16, network: Some(NetworkSizes::quick()), ..Default::default() };
        let avatar = Avatar::untrained(&model, &config, [0.5; 3], 0).unwrap();
        assert_eq!(avatar.retain(&vec![true; avatar.template.len()]), None);
    }
}
