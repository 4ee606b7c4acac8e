//! The room around the arm: a desk with things on it from wall to wall, walls with pictures, a ceiling. All cameras see
//! the same one.

use std::sync::OnceLock;

use ghand_core::Camera;
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::images::background::{Things, wood};
use crate::noise::{fractal, lattice};

/// Height of the desk, downwards, and where walls and ceiling are, metres.
pub(crate) const DESK: f64 = 0.36;
const WALL: f64 = 1.6;
const CEILING: f64 = -1.4;
/// Edge of a texel, metres: what a pixel of usual cameras sees behind the hand.
const TEXEL: f64 = 0.002;
/// Texels along a tile.
const TILE: usize = 32;
/// Things on the desk and pictures on each wall.
const DESK_THINGS: i64 = 140;
const PICTURES: i64 = 14;
/// A thing's size on the desk and a picture's on a wall, relative to [`Things::scattered`]'s, metres.
const THING_SCALE: f64 = 0.7;
const PICTURE_SCALE: f64 = 1.6;
/// Display colours of walls and the ceiling.
const PAINTS: [[f64; 3]; 4] = [[0.70, 0.70, 0.68], [0.60, 0.66, 0.68], [0.72, 0.68, 0.58], [0.56, 0.60, 0.56]];
const WHITE: Vec3 = Vec3::new(0.82, 0.82, 0.80);

/// Display colour of a place on a plate, metres from its corner.
type Paint = Box<dyn Fn(DVec2) -> DVec3 + Send + Sync>;

/// Colours of a rectangle, painted where somebody looks.
struct Plate {
    /// Columns and rows of texels.
    size: [usize; 2],
    paint: Paint,
    /// Row-major tiles of row-major display colours.
    tiles: Vec<OnceLock<Vec<Vec3>>>,
}

impl Plate {
    /// A plate of a size in metres with the colour at each place of it.
    fn painted(size: DVec2, paint: impl Fn(DVec2) -> DVec3 + Send + Sync + 'static) -> Plate {
        let size = (size / TEXEL).to_array().map(|count| count.ceil() as usize);
        let tiles = (0..size[0].div_ceil(TILE) * size[1].div_ceil(TILE)).map(|_| OnceLock::new()).collect();
        Plate { size, paint: Box::new(paint), tiles }
    }

    fn texel(&self, x: usize, y: usize) -> Vec3 {
        let [column, row] = [x / TILE, y / TILE];
        let texel = |i: usize| {
            let at = [column * TILE + i % TILE, row * TILE + i / TILE];
            let place = DVec2::from(at.map(|at| at as f64 + 0.5)) * TEXEL;
            (self.paint)(place).clamp(DVec3::ZERO, DVec3::ONE).as_vec3()
        };
        let tile = &self.tiles[row * self.size[0].div_ceil(TILE) + column];
        tile.get_or_init(|| (0..TILE * TILE).map(texel).collect())[y % TILE * TILE + x % TILE]
    }

    /// The colour at a place, interpolated; beyond its edges that of the edge.
    fn color(&self, place: DVec2) -> Vec3 {
        let last = DVec2::from(self.size.map(|count| count as f64 - 1.001));
        let at = (place / TEXEL - 0.5).clamp(DVec2::ZERO, last);
        let (x, y) = (at.x as usize, at.y as usize);
        let part = (at - at.floor()).as_vec2();
        let row = |y: usize| self.texel(x, y).lerp(self.texel(x + 1, y), part.x);
        row(y).lerp(row(y + 1), part.y)
    }
}

/// The room.
pub(crate) struct Room {
    desk: Plate,
    /// Towards +x, -x, +z, -z.
    walls: [Plate; 4],
}

impl Room {
    /// A room with its things by the seed.
    pub(crate) fn furnished(seed: u64) -> Room {
        let seed = seed ^ 0x2008;
        let light = move |place: DVec2, seed: u64| 1.0 + 0.06 * fractal(place.extend(3.0), 0.5, seed);
        let floor = DVec2::splat(2.0 * WALL);
        let things = Things::scattered(DESK_THINGS, floor / THING_SCALE, seed);
        let desk = Plate::painted(floor, move |place| {
            let color = things.color(place / THING_SCALE).unwrap_or_else(|| wood(place, seed));
            // Farther from the lamp above its middle it is darker.
            color * light(place, seed) * (1.0 - 0.10 * (place - 0.5 * floor).length())
        });
        let size = DVec2::new(2.0 * WALL, DESK - CEILING);
        let walls = std::array::from_fn(|k| {
            let seed = seed.wrapping_add(1 + k as u64);
            let paint = DVec3::from(PAINTS[(lattice(k as i64, 0, 0, seed) * PAINTS.len() as f64) as usize]);
            let pictures = Things::scattered(PICTURES, size / PICTURE_SCALE, seed);
            Plate::painted(size, move |place| {
                let color = pictures.color(place / PICTURE_SCALE).unwrap_or(paint);
                color * light(place, seed) * (0.95 - 0.12 * place.y)
            })
        });
        Room { desk, walls }
    }

    /// What the pixels of a camera see, whose rays (x/z and y/z in its axes) are these.
    pub(crate) fn seen(&self, camera: &Camera, rays: &[DVec2]) -> Vec<Vec3> {
        let eye = camera.center();
        let world_from_camera = camera.rotation.transpose();
        rays.par_iter().map(|ray| self.color(eye, world_from_camera * ray.extend(1.0))).collect()
    }

    /// What a ray from inside the room meets.
    fn color(&self, from: DVec3, direction: DVec3) -> Vec3 {
        let low = DVec3::new(-WALL, CEILING, -WALL);
        let high = DVec3::new(WALL, DESK, WALL);
        let to_side = |axis: usize| match direction[axis] {
            // Parallel to two sides.
            0.0 => f64::INFINITY,
            component if component > 0.0 => (high[axis] - from[axis]) / component,
            component => (low[axis] - from[axis]) / component,
        };
        let distances = DVec3::from_array(std::array::from_fn(to_side));
        let distance = distances.min_element();
        let at = from + distance * direction - low;
        if distance == distances.y {
            return if direction.y > 0.0 { self.desk.color(DVec2::new(at.x, at.z)) } else { WHITE };
        }
        let (wall, along) = if distance == distances.x { (0, at.z) } else { (2, at.x) };
        let is_low = if wall == 0 { direction.x < 0.0 } else { direction.z < 0.0 };
        self.walls[wall + usize::from(is_low)].color(DVec2::new(along, at.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_see_the_same_place_of_the_room_in_the_same_colour() {
        let room = Room::furnished(4);
        for target in [[0.3, DESK, -0.2], [WALL, -0.3, 0.4], [-0.6, 0.1, -WALL], [0.2, CEILING, 0.1]] {
            let target = DVec3::from(target);
            let colors = [[0.5, -0.3, 0.1], [0.4, -0.1, 0.5]].map(|eye| {
                let camera = Camera::look_at(DVec3::from(eye), target, DVec3::new(0.1, -1.0, 0.2), 1.0, 2, 2);
                room.seen(&camera, &[DVec2::ZERO])[0]
            });
            assert!(colors[0].distance(colors[1]) < 1e-3, "{target}: {colors:?}");
        }
        // It is cluttered: its colours differ.
        let camera = Camera::look_at(DVec3::new(0.6, -0.3, 0.0), DVec3::ZERO, DVec3::NEG_Y, 1.0, 2, 2);
        let rays: Vec<DVec2> = (0..400).map(|i| DVec2::new((i % 20) as f64, (i / 20) as f64) / 20.0 - 0.5).collect();
        let seen = room.seen(&camera, &rays);
        let mean = seen.iter().sum::<Vec3>() / 400.0;
        let deviation = (seen.iter().map(|color| color.distance_squared(mean)).sum::<f32>() / 400.0).sqrt();
        assert!(deviation > 0.12, "{deviation}");
    }
}
