//! The lights of synthetic captures.

use glam::DVec3;

use crate::{LightSetup, SceneLight, SceneLighting};

fn light([x, y, z]: [f64; 3], color: [f64; 3]) -> SceneLight {
    SceneLight { direction: DVec3::new(x, y, z).normalize(), color: DVec3::from(color) }
}

pub(crate) fn lighting(setup: LightSetup) -> SceneLighting {
    match setup {
        // A warm key light from above on the back's side, a weaker one from the palm's side, and a faint one from below.
        LightSetup::Soft => SceneLighting {
            ambient: DVec3::new(0.36, 0.355, 0.36),
            lights: vec![
                light([0.75, -0.55, -0.50], [0.74, 0.70, 0.64]),
                light([-0.80, -0.45, 0.35], [0.64, 0.62, 0.60]),
                light([0.10, 0.60, 0.85], [0.26, 0.23, 0.21]),
            ],
            wrap: 0.25,
        },
        // From the thumb's side, a little from above and from the back. The ambient light has the same hue, so that one
        // number says how much of both together a shadow leaves.
        LightSetup::Side => SceneLighting {
            ambient: DVec3::new(0.13, 0.125, 0.118),
            lights: vec![light([0.35, -0.30, -0.90], [1.10, 1.06, 1.00])],
            wrap: 0.05,
        },
        // All of it is in the factor of each vertex.
        LightSetup::Key | LightSetup::Rim | LightSetup::Lamp | LightSetup::Flat => {
            SceneLighting { ambient: DVec3::ONE, lights: vec![], wrap: 0.0 }
        }
    }
}
