//! Twin of `bin.wgsl` and the sorts before and after it: the splats of each tile, front to back.

use ghand_core::Camera;

use super::project::Splat;
use crate::splat::TILE_SIZE;

/// For each tile (row by row), the indices of the splats whose box touches it, ordered by depth, then by index.
pub fn bin(splats: &[Option<Splat>], camera: &Camera) -> Vec<Vec<u32>> {
    let tiles = [camera.width.div_ceil(TILE_SIZE), camera.height.div_ceil(TILE_SIZE)];
    let mut lists = vec![Vec::new(); (tiles[0] * tiles[1]) as usize];
    let mut order: Vec<(f64, u32)> =
        splats.iter().enumerate().filter_map(|(i, s)| s.map(|s| (s.depth, i as u32))).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for (_, index) in order {
        let Some(splat) = splats[index as usize] else { continue };
        let range = |axis: usize| {
            let edge = if axis == 0 { camera.width } else { camera.height };
            let first = (splat.mean[axis] - splat.reach[axis] - 0.5).ceil().max(0.0);
            let last = (splat.mean[axis] + splat.reach[axis] - 0.5).floor().min(f64::from(edge) - 1.0);
            if first <= last { first as u32 / TILE_SIZE..last as u32 / TILE_SIZE + 1 } else { 0..0 }
        };
        for y in range(1) {
            for x in range(0) {
                lists[(y * tiles[0] + x) as usize].push(index);
            }
        }
    }
    lists
}
