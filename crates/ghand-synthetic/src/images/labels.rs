//! Which pixels show the hand and not its forearm.

use ghand_core::mesh::Texture;
use glam::{DVec2, DVec3};

use crate::{SceneLighting, SceneMesh};

/// Whether each pixel shows the hand and not its forearm: from a picture of a white hand with a black forearm. `on_forearm`
/// says which vertices are on that; `render` draws it as [`RenderScene`](crate::RenderScene) does.
///
/// # Errors
/// That of `render`.
pub(crate) fn hand_alone<E>(
    scene: &SceneMesh,
    on_forearm: &[bool],
    render: impl FnOnce(&SceneMesh) -> Result<Vec<[u8; 4]>, E>,
) -> Result<Vec<bool>, E> {
    let texture = Texture { width: 2, height: 1, rgb: vec![[255; 3], [0; 3]] };
    let uvs: Vec<DVec2> = on_forearm.iter().map(|on| DVec2::new(if *on { 0.75 } else { 0.25 }, 0.5)).collect();
    let lighting = SceneLighting { ambient: DVec3::ONE, lights: vec![], wrap: 0.0 };
    let light_visibility = vec![1.0; uvs.len()];
    let labels =
        SceneMesh { uvs: &uvs, texture: &texture, lighting: &lighting, light_visibility: &light_visibility, ..*scene };
    Ok(render(&labels)?.iter().map(|pixel| pixel[3] >= 128 && pixel[0] >= 128).collect())
}
