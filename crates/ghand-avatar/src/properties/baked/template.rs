//! What the rest of an avatar needs of the template, from baked tables.

use crate::deform::baked::BakedTables;

use crate::properties::PropertyTables;

/// Rest positions `[3][N]`, skinning weights `[n_b][N]`, spacings N and normals `[3][N]`.
pub struct BakedTemplateParts {
    pub rest: Vec<f32>,
    pub weights: Vec<f32>,
    pub spacings: Vec<f32>,
    pub normals: Option<Vec<f32>>,
}

/// The template's parts: where the Gaussians are at the mean, and how large.
pub fn template_parts(tables: &BakedTables) -> BakedTemplateParts {
    let n = tables.count;
    let mut parts = BakedTemplateParts {
        rest: vec![0.0; 3 * n],
        weights: vec![0.0; tables.joint_count * n],
        spacings: vec![0.0; n],
        normals: tables.normals.then(|| vec![0.0; 3 * n]),
    };
    for p in 0..n {
        let mean = tables.mean_of(p);
        // As if no training had changed its size.
        parts.spacings[p] = (mean.scale as f32).max(f32::MIN_POSITIVE) / PropertyTables::START_SCALE;
        for c in 0..3 {
            parts.rest[c * n + p] = mean.mean[c] as f32;
            if let Some(normals) = &mut parts.normals {
                normals[c * n + p] = mean.normal.normalize_or_zero()[c] as f32;
            }
        }
        for (k, weight) in tables.weights_of(p) {
            parts.weights[k * n + p] += weight as f32;
        }
    }
    parts
}
