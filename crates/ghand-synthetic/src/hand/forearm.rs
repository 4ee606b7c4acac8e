//! The forearm of the true hand, which the template lacks: a tube from where the template's end begins, which bends at the
//! wrist.

use std::collections::HashMap;

use ghand_core::HandModel;
use ghand_hand_model::HandModelError;
use glam::{DVec2, DVec3};

use crate::noise::{noise, smoothstep};

/// Of the distance from the wrist to the farthest fingertip: the part of the mesh before its end that the forearm replaces,
/// the forearm's length, and where the bend at the wrist begins and ends.
const REPLACED: f64 = 0.062;
const LENGTH: f64 = 1.3;
const BEND: [f64; 2] = [-0.05, 0.16];
/// Width at the far end relative to the wrist's.
const WIDENING: f64 = 1.5;
/// Rings of vertices along the forearm.
const RINGS: usize = 18;
/// The part of the texture, from above, that the hand keeps; the forearm has the rest but for a margin.
const HAND_TEXTURE: f64 = 0.86;
const MARGIN: f64 = 0.01;
/// Largest angles at the wrist, radians: towards the palm or the back, and sideways. Frames over which they are alike.
const FLEXION: f64 = 0.45;
const DEVIATION: f64 = 0.2;
const FRAMES: f64 = 7.0;

/// A right hand with its forearm. The last joint is that of the forearm, at the wrist.
pub(crate) struct HandWithForearm {
    pub model: HandModel,
    /// Vertices of the hand; those of the forearm follow.
    pub hand_vertices: usize,
    /// Rest coordinate along the fingers' axis (-Y) beyond which there is only forearm, metres.
    pub end: f64,
}

/// Rotation of the forearm against the hand in a frame, axis-angle, radians: smooth from frame to frame.
pub(crate) fn bend(frame: usize, seed: u64) -> DVec3 {
    let wave = |k: u64| noise(DVec3::new(frame as f64, 0.5, 0.5), FRAMES, seed.wrapping_add(0xA43 + k));
    // The back of the hand faces +X, its width is along Z.
    DVec3::new(DEVIATION * wave(1), 0.0, FLEXION * wave(0))
}

/// Replaces the end of a hand without blend shapes by a forearm.
///
/// # Errors
/// [`HandModelError`] if the mesh has no simple end.
pub(crate) fn with_forearm(hand: &HandModel) -> Result<HandWithForearm, HandModelError> {
    let wrist = hand.joints[0];
    let heights = || hand.vertices.iter().map(|v| v.y);
    let end = heights().fold(f64::MIN, f64::max);
    let reach = wrist.y - heights().fold(f64::MAX, f64::min);
    let cut = end - REPLACED * reach;
    let is_kept = |face: &[u32; 3]| face.iter().all(|&v| hand.vertices[v as usize].y < cut);
    let kept_faces: Vec<usize> = (0..hand.faces.len()).filter(|&f| is_kept(&hand.faces[f])).collect();

    // Vertices without a face would be neither hand nor forearm.
    let mut number: Vec<Option<u32>> = vec![None; hand.vertices.len()];
    for v in kept_faces.iter().flat_map(|&f| hand.faces[f]) {
        number[v as usize] = Some(0);
    }
    let kept: Vec<usize> = (0..number.len()).filter(|&v| number[v].is_some()).collect();
    (0..).zip(&kept).for_each(|(new, &old)| number[old] = Some(new));
    let renumbered = |face: [u32; 3]| face.map(|v| number[v as usize].unwrap_or(0));
    let mut faces: Vec<[u32; 3]> = kept_faces.iter().map(|&f| renumbered(hand.faces[f])).collect();
    let mut face_uvs: Vec<[u32; 3]> = kept_faces.iter().map(|&f| hand.face_uvs[f]).collect();
    let mut vertices: Vec<DVec3> = kept.iter().map(|&v| hand.vertices[v]).collect();
    let mut uvs: Vec<DVec2> = hand.uvs.iter().map(|uv| DVec2::new(uv.x, uv.y * HAND_TEXTURE)).collect();
    let hand_vertices = vertices.len();

    let rim = border(&faces)
        .ok_or_else(|| HandModelError::invalid(hand.name.clone(), "faces", "their end at the wrist is not a ring"))?;
    let middle = rim.iter().map(|&v| vertices[v as usize]).sum::<DVec3>() / rim.len() as f64;
    let first_uv = uvs.len() as u32;
    let columns = rim.len() as u32 + 1;
    for ring in 0..=RINGS {
        let along = ring as f64 / RINGS as f64;
        let widening = 1.0 + (WIDENING - 1.0) * smoothstep(0.0, 1.0, along);
        let height = cut + (along * LENGTH + 0.01) * reach;
        if ring > 0 {
            let at = |&v: &u32| {
                let offset = vertices[v as usize] - middle;
                DVec3::new(middle.x + offset.x * widening, height, middle.z + offset.z * widening)
            };
            let points: Vec<DVec3> = rim.iter().map(at).collect();
            vertices.extend(points);
        }
        let [low, high] = [HAND_TEXTURE + MARGIN, 1.0 - MARGIN];
        let across = |column: u32| MARGIN + (1.0 - 2.0 * MARGIN) * f64::from(column) / f64::from(columns - 1);
        uvs.extend((0..columns).map(|column| DVec2::new(across(column), low + (high - low) * along)));
    }
    let count = rim.len() as u32;
    let vertex = |ring: u32, i: u32| match ring {
        0 => rim[(i % count) as usize],
        ring => hand_vertices as u32 + (ring - 1) * count + i % count,
    };
    let uv = |ring: u32, i: u32| first_uv + ring * columns + i;
    for ring in 0..RINGS as u32 {
        for i in 0..count {
            // The rim's direction is that of the hand's triangles; those on the other side have the opposite one.
            let corners = [(ring, i + 1), (ring, i), (ring + 1, i), (ring + 1, i + 1)];
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                let triangle = [corners[a], corners[b], corners[c]];
                faces.push(triangle.map(|(ring, i)| vertex(ring, i)));
                face_uvs.push(triangle.map(|(ring, i)| uv(ring, i)));
            }
        }
    }

    let joints = hand.joint_count();
    let mut weights = Vec::with_capacity(vertices.len() * (joints + 1));
    for (v, position) in vertices.iter().enumerate() {
        let mut row = vec![0.0; joints + 1];
        match kept.get(v) {
            Some(&old) => row[..joints].copy_from_slice(hand.vertex_weights(old)),
            None => row[0] = 1.0,
        }
        let [from, to] = BEND.map(|part| part * reach);
        row[joints] = row[0] * smoothstep(from, to, position.y - wrist.y);
        row[0] -= row[joints];
        weights.extend(row);
    }
    let mut model = HandModel { vertices, faces, uvs, face_uvs, weights, ..hand.without_blend_shapes() };
    model.joints.push(wrist);
    model.joint_names.push("forearm".into());
    model.parents.push(Some(0));
    Ok(HandWithForearm { model, hand_vertices, end })
}

/// The vertices around the only hole of a mesh, in the direction of its triangles.
fn border(faces: &[[u32; 3]]) -> Option<Vec<u32>> {
    let sides = || faces.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]);
    let all: std::collections::HashSet<(u32, u32)> = sides().collect();
    let next: HashMap<u32, u32> = sides().filter(|&(a, b)| !all.contains(&(b, a))).collect();
    // The least one, because a map's order is not always the same.
    let first = *next.keys().min()?;
    let mut rim = vec![first];
    while let Some(&v) = next.get(rim.last()?).filter(|v| **v != first) {
        rim.push(v);
        if rim.len() > next.len() {
            return None;
        }
    }
    (rim.len() == next.len()).then_some(rim)
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    #[test]
    fn the_forearm_continues_the_hand_and_bends_only_beyond_the_wrist() {
        let hand = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let HandWithForearm { model, hand_vertices, end } = with_forearm(&hand).unwrap();
        model.validate().unwrap();
        assert!(hand_vertices > 1600 && (end - 0.0952).abs() < 1e-3);
        let longest = model.vertices.iter().map(|v| v.y).fold(f64::MIN, f64::max);
        assert!(longest > end + 0.2, "{longest}");
        // Each triangle's edges have a neighbour in the other direction, but for the far end.
        let open = border(&model.faces).unwrap();
        assert!(open.iter().all(|&v| model.vertices[v as usize].y > longest - 1e-9));
        for (v, position) in model.vertices.iter().enumerate() {
            let part = model.vertex_weights(v)[hand.joint_count()];
            assert!(position.y > 0.045 || part == 0.0);
            assert!(position.y < 0.09 || part == 1.0);
        }
        // Normals point outwards all along.
        let normals = model.vertex_normals(&model.vertices);
        let middle = DVec3::new(0.036, 0.0, 0.009);
        for (position, normal) in model.vertices.iter().zip(&normals).filter(|(p, _)| p.y > 0.09) {
            assert!(normal.dot((*position - middle).with_y(0.0)) > 0.0, "{position}");
        }
    }

    #[test]
    fn the_wrist_bends_within_what_it_can_and_smoothly() {
        let bends: Vec<DVec3> = (0..60).map(|frame| bend(frame, 3)).collect();
        assert!(bends.iter().all(|b| b.z.abs() <= FLEXION && b.x.abs() <= DEVIATION && b.y == 0.0));
        let steps = bends.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, f64::max);
        assert!(steps < 0.2 && bends.iter().any(|b| b.z > 0.15) && bends.iter().any(|b| b.z < -0.15), "{steps}");
    }
}
