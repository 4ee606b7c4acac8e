//! Files of scenes of Gaussians.

use std::path::Path;

use ghand_avatar::scene_files::SplatScene;

/// Reads a scene, and warns of numbers that are probably not what the format says.
///
/// # Errors
/// One sentence that names the file and the invalid part.
pub fn read_scene_file(path: &Path) -> anyhow::Result<SplatScene> {
    let scene = SplatScene::read(path)?;
    scene.suspicions().iter().for_each(|suspicion| log::warn!("{}: {suspicion}", path.display()));
    Ok(scene)
}
