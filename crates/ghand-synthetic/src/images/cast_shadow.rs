//! Shadows that a hand casts on itself in one strong light: a map of heights towards the light.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::hand::true_hand::PosedTrueHand;
use crate::{PlantedLight, SceneLighting};

/// Edge of a cell of the map, metres. The hand's vertices are about 0.5 mm apart, so that every cell has some.
const CELL: f64 = 0.001;
/// What is higher by less than this, metres, is the same piece of skin.
const LEAST_HEIGHT: f64 = 0.003;
/// Width of the edge of a shadow to either side, cells.
const SOFTNESS: f64 = 2.5;

/// Takes the shadow of the first light from the light that reaches the hand.
pub(crate) fn add_shadow(hand: &mut PosedTrueHand, lighting: &SceneLighting) {
    let Some(light) = lighting.lights.first() else { return };
    let map = HeightMap::of(&hand.positions, light.direction);
    let brightness = |color: DVec3| color.element_sum() / 3.0;
    let ambient = brightness(lighting.ambient);
    let skin = hand.positions.par_iter().zip(&hand.normals);
    hand.light_visibility.par_iter_mut().zip(skin).for_each(|(visibility, (position, normal))| {
        let cosine = ((normal.dot(light.direction) + lighting.wrap) / (1.0 + lighting.wrap)).max(0.0);
        let direct = brightness(light.color) * cosine;
        *visibility *= (ambient + direct * map.lit_part(*position)) / (ambient + direct);
    });
}

/// Replaces how much light reaches each vertex by the factor of a planted light on its display value.
pub(crate) fn plant_light(hand: &mut PosedTrueHand, light: &PlantedLight) {
    if light.key == 0.0 {
        hand.light_visibility.fill(light.sky);
        return;
    }
    // Seen from a near lamp, rays from it are parallel after division by the distance along its axis.
    let from_lamp = |p: DVec3| {
        let along = light.distance - p.dot(light.towards);
        let across = p - light.towards * p.dot(light.towards);
        across * (light.distance / along) - light.towards * along
    };
    let is_near = light.distance.is_finite();
    let seen: Vec<DVec3> = hand.positions.iter().map(|p| if is_near { from_lamp(*p) } else { *p }).collect();
    let map = HeightMap::of(&seen, light.towards);
    let skin = hand.positions.par_iter().zip(&hand.normals).zip(&seen);
    hand.light_visibility.par_iter_mut().zip(skin).for_each(|(visibility, ((position, normal), seen))| {
        let to_lamp = light.towards * light.distance - *position;
        let (towards, nearer) = match is_near {
            true => (to_lamp.normalize(), light.distance * light.distance / to_lamp.length_squared()),
            false => (light.towards, 1.0),
        };
        let direct = light.key * nearer * normal.dot(towards).max(0.0);
        let lit = if direct > 0.0 { map.lit_part(*seen) } else { 0.0 };
        *visibility = (light.sky * *visibility + direct * lit).powf(1.0 / 2.2);
    });
}

/// The greatest height towards a light in each cell of a plane across it.
struct HeightMap {
    /// Unit vectors across the light, and towards it.
    axes: [DVec3; 3],
    /// Corner of the first cell.
    low: DVec2,
    columns: usize,
    /// Row-major, metres.
    heights: Vec<f64>,
}

impl HeightMap {
    fn of(points: &[DVec3], direction: DVec3) -> HeightMap {
        let (x, y) = direction.any_orthonormal_pair();
        let on_plane = |p: &DVec3| DVec2::new(p.dot(x), p.dot(y));
        let (low, high) = (points.iter().map(on_plane))
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let [columns, rows] = ((high - low) / CELL).to_array().map(|cells| cells.max(0.0) as usize + 1);
        let mut map =
            HeightMap { axes: [x, y, direction], low, columns, heights: vec![f64::NEG_INFINITY; columns * rows] };
        for point in points {
            let cell = ((on_plane(point) - low) / CELL).as_usizevec2();
            let height = &mut map.heights[cell.y * columns + cell.x];
            *height = height.max(point.dot(direction));
        }
        map
    }

    /// The part of the light that reaches a point, `[0, 1]`.
    fn lit_part(&self, point: DVec3) -> f64 {
        let [x, y, towards] = self.axes;
        // In cells, whose centres have whole coordinates.
        let at = (DVec2::new(point.dot(x), point.dot(y)) - self.low) / CELL - 0.5;
        let own = point.dot(towards) + LEAST_HEIGHT;
        let rows = self.heights.len() / self.columns;
        let near = |v: f64, count: usize| {
            let first = (v - SOFTNESS).ceil().max(0.0) as usize;
            first..((v + SOFTNESS).floor().max(-1.0) + 1.0).min(count as f64) as usize
        };
        let mut lit = 0.0;
        let mut all = 0.0;
        for row in near(at.y, rows) {
            for column in near(at.x, self.columns) {
                let away = (DVec2::new(column as f64, row as f64) - at).abs();
                let weight = (SOFTNESS - away.x).max(0.0) * (SOFTNESS - away.y).max(0.0);
                all += weight;
                if self.heights[row * self.columns + column] <= own {
                    lit += weight;
                }
            }
        }
        if all > 0.0 { lit / all } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_behind_something_is_dark_and_the_rest_is_lit() {
        // A plane of 60 x 60 mm, and 20 mm above its middle a plate of 20 x 20 mm; the light comes from above.
        let grid = |half: i32, z: f64| {
            (-2 * half..=2 * half).flat_map(move |i| {
                (-2 * half..=2 * half).map(move |j| DVec3::new(f64::from(i) * 5e-4, f64::from(j) * 5e-4, z))
            })
        };
        let points: Vec<DVec3> = grid(30, 0.0).chain(grid(10, 0.02)).collect();
        let map = HeightMap::of(&points, DVec3::Z);
        for (point, expected) in [([0.0, 0.0, 0.0], 0.0), ([0.0, 0.0, 0.02], 1.0), ([0.02, 0.0, 0.0], 1.0)] {
            assert_eq!(map.lit_part(DVec3::from(point)), expected, "{point:?}");
        }
        assert!((0.2..0.8).contains(&map.lit_part(DVec3::new(0.0105, 0.0, 0.0))), "the edge is soft");
    }
}
