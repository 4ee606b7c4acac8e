//! The colours of a person's skin; display values.

use glam::DVec3;

use crate::noise::lattice;

/// Colours that the skin is mixed from.
#[derive(Debug, Clone)]
pub(crate) struct Complexion {
    pub back: DVec3,
    pub palm: DVec3,
    /// Where more blood shows.
    pub blood: DVec3,
    /// Where bones or tendons press it away.
    pub pale: DVec3,
    pub vein: DVec3,
    /// At the bottom of folds.
    pub crease: DVec3,
    pub freckle: DVec3,
    /// The fraction of possible places with a freckle, on the back of the hand.
    pub freckles: f64,
    pub nail: DVec3,
    /// The nail's free edge and lunula.
    pub nail_edge: DVec3,
}

impl Complexion {
    /// From light with many freckles to dark with few, by the seed.
    pub(crate) fn of(seed: u64) -> Complexion {
        let dark = lattice(1, 2, 3, seed ^ 0xC0_107);
        let mix = |light: [f64; 3], deep: [f64; 3]| DVec3::from(light).lerp(DVec3::from(deep), dark);
        let back = mix([0.83, 0.635, 0.535], [0.375, 0.245, 0.18]);
        let palm = mix([0.92, 0.735, 0.65], [0.69, 0.485, 0.39]);
        Complexion {
            back,
            palm,
            blood: mix([0.84, 0.41, 0.36], [0.50, 0.22, 0.17]),
            pale: back.lerp(DVec3::new(0.96, 0.86, 0.72), 0.35),
            vein: back * mix([0.60, 0.80, 1.02], [0.78, 0.90, 1.04]),
            crease: back * mix([0.64, 0.48, 0.43], [0.50, 0.42, 0.40]),
            freckle: back * mix([0.62, 0.52, 0.43], [0.55, 0.50, 0.48]),
            freckles: 0.10 + 0.32 * (1.0 - dark) * lattice(4, 5, 6, seed),
            nail: palm.lerp(DVec3::new(0.93, 0.70, 0.65), 0.55),
            nail_edge: DVec3::new(0.95, 0.91, 0.86).lerp(palm, 0.25 + 0.25 * dark),
        }
    }
}
