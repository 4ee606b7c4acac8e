//! The canonical points of an avatar: the texels of the UV atlas that are on the hand.

pub mod arm_end;
mod merged;
pub mod smooth;
pub mod uv_atlas;

use ghand_core::HandModel;
use glam::{DVec2, DVec3};

use crate::HandModelError;

/// Largest resolution of the atlas that is sampled: 16 million texels.
const MAX_RESOLUTION: u32 = 4096;

/// `N` points of the rest surface, one for each texel whose centre is in a triangle of the atlas.
///
/// Texel (row `j`, column `i`) has its centre at UV `((i + 0.5) / resolution, (j + 0.5) / resolution)`. All per-point
/// lists are in the order of `texels`.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceSamples {
    /// Rows and columns of the UV raster.
    pub resolution: u32,
    /// Number of joints, `n_b`.
    pub joint_count: usize,
    /// `row * resolution + column` of each point, ascending.
    pub texels: Vec<u32>,
    /// Triangle of the model on which each point lies.
    pub faces: Vec<u32>,
    /// Barycentric coordinates on that triangle, in the order of its corners; they sum to 1.
    pub barycentric: Vec<[f64; 3]>,
    /// Rest positions, metres, model axes.
    pub positions: Vec<DVec3>,
    /// Outward unit normals, interpolated between those of the vertices.
    pub normals: Vec<DVec3>,
    /// Skinning weights, joint-major `[n_b][N]`; the weights of a point sum to 1.
    pub weights: Vec<f64>,
    /// Square root of the area of the surface that the point stands for, one texel or several, metres.
    pub spacings: Vec<f64>,
    /// Texels whose centre is strictly inside several triangles. 0 for a one-to-one atlas.
    pub overlaps: usize,
}

impl SurfaceSamples {
    /// Number of points, `N`.
    pub fn len(&self) -> usize {
        self.texels.len()
    }

    /// Whether there is no point. Never true for the result of [`sample_surface`].
    pub fn is_empty(&self) -> bool {
        self.texels.is_empty()
    }

    /// Values of the vertices at the points: `rows` is `[r][V]` (blend-shape rows, posed vertices, ...) of the model
    /// that was sampled, the result `[r][N]`, in the unit of the rows.
    pub fn interpolate(&self, model: &HandModel, rows: &[DVec3]) -> Vec<DVec3> {
        let at_point = |row: &[DVec3], point: usize| -> DVec3 {
            let corners = model.faces[self.faces[point] as usize];
            self.barycentric[point].iter().zip(corners).map(|(b, i)| *b * row[i as usize]).sum()
        };
        rows.chunks_exact(model.vertices.len().max(1))
            .flat_map(|row| (0..self.len()).map(move |point| at_point(row, point)))
            .collect()
    }

    /// Mean of `spacings`, metres; 0 without points.
    pub fn mean_spacing(&self) -> f64 {
        if self.is_empty() { 0.0 } else { self.spacings.iter().sum::<f64>() / self.len() as f64 }
    }
}

/// Texels whose centre is this close to an edge, as a barycentric coordinate, count as on it: about the rounding error
/// of the coordinates, so that no texel is lost between two triangles.
const EDGE: f64 = 1e-9;

#[derive(Clone, Copy)]
struct Hit {
    face: u32,
    barycentric: [f64; 3],
    strictly_inside: bool,
    /// Whether the texel's centre is strictly inside another triangle, too.
    is_shared: bool,
}

/// Samples the rest surface at the texels of a `resolution` x `resolution` raster of the UV atlas.
///
/// At a shared edge the triangle with the lowest index takes the texel. Triangles without area in the atlas are
/// skipped, and so are parts of the atlas outside `[0, 1]^2`.
///
/// # Errors
/// [`HandModelError::Invalid`] if `resolution` is 0 or above 4096, the model breaks its invariants, or no texel is hit.
pub fn sample_surface(model: &HandModel, resolution: u32) -> Result<SurfaceSamples, HandModelError> {
    let (hits, overlaps, count) = hits_of(model, resolution)?;
    let vertex_normals = model.vertex_normals(&model.vertices);
    let texel_size = 1.0 / f64::from(resolution);
    let n_b = model.joint_count();
    let mut samples = SurfaceSamples {
        resolution,
        joint_count: n_b,
        texels: Vec::with_capacity(count),
        faces: Vec::with_capacity(count),
        barycentric: Vec::with_capacity(count),
        positions: Vec::with_capacity(count),
        normals: Vec::with_capacity(count),
        weights: vec![0.0; n_b * count],
        spacings: Vec::with_capacity(count),
        overlaps,
    };
    for (texel, hit) in hits.iter().enumerate() {
        let Some(Hit { face, barycentric: b, .. }) = *hit else { continue };
        let point = samples.texels.len();
        let corners = model.faces[face as usize].map(|i| i as usize);
        let mix = |values: &[DVec3]| (0..3).map(|k| b[k] * values[corners[k]]).sum::<DVec3>();
        let [p, q, r] = corners.map(|i| model.vertices[i]);
        let flat = (q - p).cross(r - p);
        let normal = mix(&vertex_normals).normalize_or_zero();
        let uv_area = uv_area(model.face_uvs[face as usize].map(|i| model.uvs[i as usize])).abs();
        samples.texels.push(texel as u32);
        samples.faces.push(face);
        samples.barycentric.push(b);
        samples.positions.push(mix(&model.vertices));
        // Opposite normals may cancel on a fold; the triangle's own direction is the next best.
        samples.normals.push(if normal == DVec3::ZERO { flat.normalize_or(DVec3::X) } else { normal });
        samples.spacings.push((0.5 * flat.length() / uv_area).sqrt() * texel_size);
        for (k, corner) in corners.into_iter().enumerate() {
            for (joint, w) in model.vertex_weights(corner).iter().enumerate() {
                samples.weights[joint * count + point] += b[k] * w;
            }
        }
    }
    Ok(samples)
}

/// How many points [`sample_surface`] finds, and at how many of them the atlas overlaps itself.
///
/// # Errors
/// As of [`sample_surface`].
pub fn count_texels(model: &HandModel, resolution: u32) -> Result<[usize; 2], HandModelError> {
    let (_, overlaps, count) = hits_of(model, resolution)?;
    Ok([count, overlaps])
}

/// What the texels hit, at how many the atlas overlaps itself, and how many hit anything.
fn hits_of(model: &HandModel, resolution: u32) -> Result<(Vec<Option<Hit>>, usize, usize), HandModelError> {
    let fail = |field: &str, problem: String| Err(HandModelError::invalid(model.name.clone(), field, problem));
    if resolution == 0 || resolution > MAX_RESOLUTION {
        return fail("UV resolution", format!("is {resolution}; choose 1 to {MAX_RESOLUTION}"));
    }
    model.validate()?;
    let (hits, overlaps) = rasterize(model, resolution);
    let count = hits.iter().flatten().count();
    if count == 0 {
        return fail(
            "uv",
            format!(
                "no texel centre of a {resolution} x {resolution} raster is in a triangle; choose a higher resolution \
                 or check that the atlas fills [0, 1]^2"
            ),
        );
    }
    Ok((hits, overlaps, count))
}

/// Signed area, positive if the corners turn from u to v.
fn uv_area([a, b, c]: [DVec2; 3]) -> f64 {
    0.5 * (b - a).perp_dot(c - a)
}

/// The triangle of each texel, and the number of overlaps.
fn rasterize(model: &HandModel, resolution: u32) -> (Vec<Option<Hit>>, usize) {
    let size = f64::from(resolution);
    let mut hits: Vec<Option<Hit>> = vec![None; resolution as usize * resolution as usize];
    let mut overlaps = 0;
    for (face, indices) in model.face_uvs.iter().enumerate() {
        // In texels, with centres at whole numbers.
        let [a, b, c] = indices.map(|i| model.uvs[i as usize] * size - DVec2::splat(0.5));
        let doubled = 2.0 * uv_area([a, b, c]);
        // Smaller than rounding: no centre is certainly inside.
        if doubled.abs() <= 1e-12 || !doubled.is_finite() {
            continue;
        }
        // Whole numbers within the box, at least 0 and below the resolution; a huge value saturates harmlessly.
        let low = a.min(b).min(c).ceil().max(DVec2::ZERO);
        let high = a.max(b).max(c).floor().min(DVec2::splat(size - 1.0));
        if !(low.x <= high.x && low.y <= high.y) {
            continue;
        }
        for row in low.y as usize..=high.y as usize {
            for column in low.x as usize..=high.x as usize {
                let p = DVec2::new(column as f64, row as f64);
                let first = (b - p).perp_dot(c - p) / doubled;
                let second = (c - p).perp_dot(a - p) / doubled;
                let raw = [first, second, 1.0 - first - second];
                let least = raw.iter().copied().fold(f64::INFINITY, f64::min);
                if least < -EDGE {
                    continue;
                }
                let strictly_inside = least > EDGE;
                match &mut hits[row * resolution as usize + column] {
                    Some(first) if first.strictly_inside && strictly_inside => {
                        overlaps += usize::from(!first.is_shared);
                        first.is_shared = true;
                    }
                    Some(_) => {}
                    empty => {
                        // Rounding may leave a coordinate just below 0, which would make a negative weight.
                        let kept = raw.map(|v| v.max(0.0));
                        let sum: f64 = kept.iter().sum();
                        *empty = Some(Hit {
                            face: face as u32,
                            barycentric: kept.map(|v| v / sum),
                            strictly_inside,
                            is_shared: false,
                        });
                    }
                }
            }
        }
    }
    (hits, overlaps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::gltf::read_gltf;
    use ghand_core::Side;
    use ghand_test_support::procedural_hand::ProceduralHand;
    use ghand_test_support::shared;

    /// A unit square of two triangles, one joint, its atlas filling [0, 1]^2.
    fn square() -> HandModel {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        HandModel {
            name: "square".into(),
            side: Side::Right,
            joint_names: vec!["root".into(), "tip".into()],
            parents: vec![None, Some(0)],
            joints: vec![DVec3::ZERO, DVec3::X],
            vertices: corners.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
            uvs: corners.iter().map(|&(x, y)| DVec2::new(x, y)).collect(),
            face_uvs: vec![[0, 1, 2], [0, 2, 3]],
            weights: vec![1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0],
            shape_directions: vec![],
            shape_names: vec![],
            pose_directions: vec![],
            joint_regressor: vec![],
            joint_directions: vec![],
            pose_space: None,
            source_vertices: vec![],
        }
    }

    #[test]
    fn a_square_atlas_gives_every_texel_once_at_its_position() {
        let samples = sample_surface(&square(), 8).unwrap();
        assert_eq!(samples.len(), 64);
        assert_eq!(samples.overlaps, 0);
        assert!(samples.texels.iter().enumerate().all(|(k, &t)| k as u32 == t));
        for (k, p) in samples.positions.iter().enumerate() {
            let expected = DVec3::new(((k % 8) as f64 + 0.5) / 8.0, ((k / 8) as f64 + 0.5) / 8.0, 0.0);
            assert!((*p - expected).length() < 1e-15);
            // The weight of the second joint is x: rounding only.
            assert!((samples.weights[64 + k] - expected.x).abs() < 1e-15);
            assert!((samples.weights[k] + samples.weights[64 + k] - 1.0).abs() < 1e-15);
        }
        assert!((samples.mean_spacing() - 1.0 / 8.0).abs() < 1e-15);
        assert!(samples.normals.iter().all(|n| (*n - DVec3::Z).length() < 1e-15));
    }

    #[test]
    fn rows_of_vertex_values_are_interpolated_like_the_positions() {
        let model = square();
        let samples = sample_surface(&model, 8).unwrap();
        let doubled: Vec<DVec3> = model.vertices.iter().map(|v| *v * 2.0).collect();
        let rows = samples.interpolate(&model, &[model.vertices.clone(), doubled].concat());
        assert_eq!(rows[..64], samples.positions);
        assert!(rows[64..].iter().zip(&samples.positions).all(|(a, b)| *a == *b * 2.0));
    }

    #[test]
    fn the_lowest_face_takes_texels_on_a_shared_edge() {
        // With an odd or even resolution alike, the diagonal passes through texel centres.
        let samples = sample_surface(&square(), 5).unwrap();
        for (texel, face) in samples.texels.iter().zip(&samples.faces) {
            let (row, column) = (texel / 5, texel % 5);
            assert_eq!(*face, u32::from(row > column));
        }
    }

    #[test]
    fn the_overlaps_of_an_atlas_are_counted() {
        let mut model = square();
        model.face_uvs[1] = [0, 1, 2];
        let samples = sample_surface(&model, 16).unwrap();
        assert_eq!(samples.overlaps, samples.barycentric.iter().filter(|b| b.iter().all(|v| *v > EDGE)).count());
        assert!(samples.overlaps > 50);
    }

    #[test]
    fn unusable_resolutions_and_empty_atlases_are_errors() {
        for resolution in [0, 4097] {
            let message = sample_surface(&square(), resolution).unwrap_err().to_string();
            assert!(message.contains("square: UV resolution"), "{message}");
        }
        let mut model = square();
        model.uvs.iter_mut().for_each(|uv| *uv += DVec2::splat(7.0));
        assert!(sample_surface(&model, 64).unwrap_err().to_string().contains("no texel"));
        model.uvs.fill(DVec2::splat(0.5));
        assert!(sample_surface(&model, 64).is_err());
    }

    fn check_hand(model: &HandModel) {
        for resolution in [128, 512] {
            let samples = sample_surface(model, resolution).unwrap();
            assert_eq!(samples.overlaps, 0, "{} at {resolution}", model.name);
            assert!(samples.texels.windows(2).all(|pair| pair[0] < pair[1]));
            let n = samples.len();
            for k in 0..n {
                let sum: f64 = (0..samples.joint_count).map(|j| samples.weights[j * n + k]).sum();
                assert!((sum - 1.0).abs() < 1e-6 && (samples.normals[k].length() - 1.0).abs() < 1e-12);
            }
            let mut spacings = samples.spacings.clone();
            spacings.sort_by(f64::total_cmp);
            let ratio = spacings[n * 95 / 100] / spacings[n * 5 / 100];
            println!(
                "{} at {resolution}: {n} texels, mean spacing {:.3} mm, p95/p5 {ratio:.2}",
                model.name,
                samples.mean_spacing() * 1e3
            );
            // Every texel stands for its own piece of skin: together they cover the surface.
            let area: f64 = samples.spacings.iter().map(|s| s * s).sum();
            let [p, q, r] = [0, 1, 2].map(|c| move |f: &[u32; 3]| model.vertices[f[c] as usize]);
            let surface: f64 = model.faces.iter().map(|f| 0.5 * (q(f) - p(f)).cross(r(f) - p(f)).length()).sum();
            // Texels at chart borders are counted wholly or not at all.
            assert!((area / surface - 1.0).abs() < 0.02, "{area} of {surface}");
        }
    }

    #[test]
    fn the_procedural_atlas_is_one_to_one_dense_and_even() {
        let model = ProceduralHand::default().build().unwrap();
        check_hand(&model);
        let samples = sample_surface(&model, 512).unwrap();
        // More texels than on MANO's atlas (87,780), of nearly one size.
        assert!(samples.len() > 100_000, "{}", samples.len());
        let mut spacings = samples.spacings.clone();
        spacings.sort_by(f64::total_cmp);
        let ratio = spacings[samples.len() * 95 / 100] / spacings[samples.len() * 5 / 100];
        assert!(ratio < 1.5, "{ratio}");
    }

    #[test]
    fn other_procedural_hands_have_one_to_one_atlases_too() {
        let slim = ProceduralHand { finger_lengths: [0.095, 0.105, 0.1, 0.085], detail: 1, ..Default::default() };
        let broad = ProceduralHand { palm_width: 0.070, palm_thickness: 0.032, left: true, ..Default::default() };
        check_hand(&slim.build().unwrap());
        check_hand(&broad.build().unwrap());
    }

    #[test]
    fn the_generic_hands_atlas_is_one_to_one() {
        let Some(path) = shared("assets/generic-hand/right.glb") else { return };
        check_hand(&read_gltf(&path, None).unwrap().model);
    }
}
