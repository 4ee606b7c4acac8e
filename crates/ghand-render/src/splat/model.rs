//! The parameters of a scene's Gaussians: "model only what the scene requires".

use crate::reference::project::{BLUR, Filter, NARROW_BLUR};

/// Parameters of the sizes of Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shape {
    /// One standard deviation.
    #[default]
    Isotropic,
    /// Three standard deviations along the axes of a rotation (a quaternion w, x, y, z of any non-zero norm).
    Anisotropic,
    /// One standard deviation across a unit normal, and [`FLATNESS`] times that along it; a normal of 0 is isotropic.
    /// The normals are given: their gradient is 0.
    Flat,
}

/// Thickness of a flat Gaussian as a fraction of its size.
pub const FLATNESS: f64 = 0.2;

/// Source of the opacity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Opacity {
    /// One for all Gaussians, set in the view.
    #[default]
    Shared,
    /// One per Gaussian.
    Free,
}

/// Parameters of the colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Color {
    /// The same in all directions.
    #[default]
    Rgb,
    /// Spherical harmonics of degree 0 to 3: `max(0, 0.5 + sum c_lm Y_lm(direction from camera to Gaussian))`.
    SphericalHarmonics(u32),
}

/// The parametrisation in which sizes and opacities are stored and differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Stored {
    /// Sizes in metres, opacities from 0 to 1.
    #[default]
    Plain,
    /// Logarithms of metres, and logits, as stored by trainers of Gaussian splats.
    Unbounded,
}

/// The kind of a scene's Gaussians. Pipelines are compiled for one kind; unused features cost nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SplatModel {
    /// Sizes.
    pub shape: Shape,
    /// Opacity.
    pub opacity: Opacity,
    /// Colour.
    pub color: Color,
    /// How sizes and free opacities are stored.
    pub stored: Stored,
    /// Whether opacity is reduced to compensate for the screen-space blur, so that a Gaussian's total contribution
    /// stays the same.
    pub antialias: bool,
    /// Whether that blur is 0.1 square pixels, as in Mip-Splatting, and not 0.3, as in 3D Gaussian Splatting.
    pub narrow: bool,
}

impl SplatModel {
    /// The Gaussians of a hand: isotropic, with one opacity for all, and view-independent colour.
    pub const HAND: SplatModel = SplatModel {
        shape: Shape::Isotropic,
        opacity: Opacity::Shared,
        color: Color::Rgb,
        stored: Stored::Plain,
        antialias: false,
        narrow: false,
    };

    /// The Gaussians of a 3D Gaussian Splatting `.ply` file, with spherical harmonics of this degree.
    pub fn trained(degree: u32) -> SplatModel {
        SplatModel {
            shape: Shape::Anisotropic,
            opacity: Opacity::Free,
            color: Color::SphericalHarmonics(degree),
            stored: Stored::Unbounded,
            antialias: false,
            narrow: false,
        }
    }

    /// The screen-space blur as the twin takes it.
    pub fn filter(&self) -> Filter {
        Filter { antialias: self.antialias, blur: if self.narrow { NARROW_BLUR } else { BLUR } }
    }

    /// First row of the sizes (1 or 3 rows) in the table of Gaussians, after the three rows of the mean.
    pub const SCALE_ROW: usize = 3;

    /// Number of size rows.
    pub fn scale_rows(&self) -> usize {
        if self.shape == Shape::Anisotropic { 3 } else { 1 }
    }

    /// First row of the quaternion or normal, if the kind has one.
    pub fn rotation_row(&self) -> usize {
        Self::SCALE_ROW + self.scale_rows()
    }

    /// Row of the opacity, if it is free.
    pub fn opacity_row(&self) -> usize {
        self.rotation_row()
            + match self.shape {
                Shape::Isotropic => 0,
                Shape::Anisotropic => 4,
                Shape::Flat => 3,
            }
    }

    /// First row of the colour: red, green, blue, or the harmonics' coefficients, three rows each.
    pub fn color_row(&self) -> usize {
        self.opacity_row() + usize::from(self.opacity == Opacity::Free)
    }

    /// Number of basis functions of the colour; 0 for plain colours.
    pub fn color_bases(&self) -> usize {
        match self.color {
            Color::Rgb => 0,
            Color::SphericalHarmonics(degree) => (degree as usize + 1).pow(2),
        }
    }

    /// Number of rows of the table of Gaussians.
    pub fn rows(&self) -> usize {
        self.color_row() + 3 * self.color_bases().max(1)
    }

    /// The place of a number in a table of `count` Gaussians: `[rows][N]`, but the coefficients of harmonics are behind
    /// the other rows by Gaussian, `[N][3 * bases]`, because a Gaussian's are used together.
    pub fn index(&self, row: usize, gaussian: usize, count: usize) -> usize {
        let first = self.color_row();
        let bases = self.color_bases();
        if bases == 0 || row < first {
            row * count + gaussian
        } else {
            first * count + gaussian * 3 * bases + row - first
        }
    }

    /// The table of `count` Gaussians with the number `value(row, gaussian)` in each row.
    pub fn table(&self, count: usize, value: impl Fn(usize, usize) -> f32) -> Vec<f32> {
        let mut table = vec![0.0; self.rows() * count];
        for row in 0..self.rows() {
            (0..count).for_each(|i| table[self.index(row, i, count)] = value(row, i));
        }
        table
    }

    /// The `override` constants of the shaders that access the table.
    pub(super) fn constants(&self) -> Vec<(&'static str, f64)> {
        let flag = |on: bool| f64::from(u8::from(on));
        vec![
            ("ANISOTROPIC", flag(self.shape == Shape::Anisotropic)),
            ("FLAT", flag(self.shape == Shape::Flat)),
            ("FLATNESS", FLATNESS),
            ("FREE_OPACITY", flag(self.opacity == Opacity::Free)),
            ("COLOR_BASES", self.color_bases() as f64),
            ("UNBOUNDED", flag(self.stored == Stored::Unbounded)),
            ("ANTIALIAS", flag(self.antialias)),
            ("NARROW", flag(self.narrow)),
            ("ROW_SCALE", Self::SCALE_ROW as f64),
            ("ROW_ROTATION", self.rotation_row() as f64),
            ("ROW_OPACITY", self.opacity_row() as f64),
            ("ROW_COLOR", self.color_row() as f64),
        ]
    }

    /// Whether slots store the gradient of the opacity: because it is an output, or because the opacity depends on the
    /// size.
    pub(super) fn slot_opacity(&self) -> bool {
        self.opacity == Opacity::Free || self.antialias
    }
}
