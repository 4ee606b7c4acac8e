//! Input of the mesh renderer: meshes, surfaces, lights and lines, and their validation.

use crate::RenderError;
use ghand_core::Camera;
use ghand_core::mesh::Texture;
use glam::{DVec2, DVec3};

/// The largest number of lights in a [`Shading::Lit`].
pub const MAX_LIGHTS: usize = 4;
/// The largest supersampling factor.
pub const MAX_SUPERSAMPLE: u32 = 4;
/// The thinnest and the widest lines of a [`Wireframe`], pixels.
pub const LINE_WIDTHS: [f64; 2] = [0.25, 16.0];
/// Largest distance of a vertex from the camera along each axis, metres: beyond it f32 cannot resolve a hand, and the
/// units must be wrong.
pub const FARTHEST: f64 = 1e5;

/// Why a mesh could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// Part of the input is unusable.
    #[error("mesh: {field}: {problem}")]
    Invalid {
        /// The part that is wrong.
        field: &'static str,
        /// What is wrong and what to do.
        problem: String,
    },
    /// The device failed while drawing or reading the image back, or was lost.
    #[error("mesh: {0}")]
    Device(#[from] RenderError),
}

impl MeshError {
    pub(crate) fn invalid<T>(field: &'static str, problem: impl Into<String>) -> Result<T, MeshError> {
        Err(MeshError::Invalid { field, problem: problem.into() })
    }
}

/// The source of a mesh's colours, in display values; no transfer curve is applied.
#[derive(Debug, Clone, Copy)]
pub enum Surface<'a> {
    /// A texture, filtered bilinearly.
    Texture {
        /// UV of each vertex, (0, 0) at the corner of the first texel; outside `[0, 1]` the border texels repeat.
        uvs: &'a [DVec2],
        /// Colours.
        texture: &'a Texture,
    },
    /// One colour per vertex, `[0, 1]`, interpolated over the triangles. [`super::weights`] makes colours from skinning
    /// weights.
    VertexColors(&'a [DVec3]),
    /// One colour, `[0, 1]`.
    Color(DVec3),
}

/// A posed mesh, borrowed for one image.
#[derive(Debug, Clone, Copy)]
pub struct MeshInstance<'a> {
    /// Vertex positions, metres, world axes.
    pub positions: &'a [DVec3],
    /// Vertex normals, world axes; any length, normalised per pixel after interpolation.
    pub normals: &'a [DVec3],
    /// The fraction of light that reaches each vertex past other geometry, `[0, 1]`; `None` for all of it. Unlit
    /// shading ignores it.
    pub light_visibility: Option<&'a [f64]>,
    /// Triangles as vertex indices; both sides are drawn.
    pub triangles: &'a [[u32; 3]],
    /// Colours.
    pub surface: Surface<'a>,
}

/// A directional light fixed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Direction from the scene towards the light, world axes, with any non-zero length.
    pub direction: DVec3,
    /// Its contribution to the surface's factor at perpendicular incidence, linear in display values.
    pub color: DVec3,
}

/// How pixel colours are computed from the surface's colours.
#[derive(Debug, Clone, PartialEq)]
pub enum Shading {
    /// The surface's colours unchanged.
    Unlit,
    /// Lambert: colour x visibility x (ambient + sum of lights), clamped to 1.
    Lit {
        /// Ambient light.
        ambient: DVec3,
        /// At most [`MAX_LIGHTS`] lights.
        lights: Vec<Light>,
        /// Softness of the terminator, in `[0, 1]`: the cosine c of a light counts as max(0, (c + wrap) / (1 + wrap)).
        /// Zero is Lambert; skin, which scatters light below its surface, looks natural near 0.3.
        wrap: f64,
    },
    /// Faces are invisible, but hide the lines behind them.
    Transparent,
}

impl Shading {
    /// A light above the photographer's left shoulder, and `ambient` light, `[0, 1]`. Their sum is slightly above white
    /// at perpendicular incidence, which is rare.
    pub fn soft(camera: &Camera, ambient: f64) -> Shading {
        let direction = camera.rotation.transpose() * DVec3::new(-0.5, -0.7, -1.0);
        let key = Light { direction, color: DVec3::splat(1.1 - ambient) };
        Shading::Lit { ambient: DVec3::splat(ambient), lights: vec![key], wrap: 0.3 }
    }
}

/// The mesh's edges as lines.
///
/// A line has its full width everywhere, also on the outline, and round ends. Faces hide what is behind them: that is
/// decided at its centre line, for the whole width at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wireframe {
    /// Width, pixels of the image, within [`LINE_WIDTHS`].
    pub width: f64,
    /// Colour, display values.
    pub color: DVec3,
}

impl Wireframe {
    /// Margin of pixels to draw around the image, so that lines outside it extend correctly into it.
    pub(crate) fn margin(&self) -> u32 {
        (self.width / 2.0).ceil() as u32 + 1
    }
}

/// How to draw a mesh. The background is transparent.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshStyle {
    /// Samples per pixel along each axis, 1 to [`MAX_SUPERSAMPLE`]. Lines are antialiased even with 1, faces are not.
    pub supersample: u32,
    /// Shading of the faces.
    pub shading: Shading,
    /// Lines over the faces.
    pub wireframe: Option<Wireframe>,
}

/// Checks the input for both the GPU and its twin.
///
/// # Errors
/// [`MeshError::Invalid`] names the first field that is unusable.
pub(crate) fn check_input(mesh: &MeshInstance, camera: &Camera, style: &MeshStyle) -> Result<(), MeshError> {
    check_camera(camera)?;
    check_mesh(mesh, camera)?;
    check_surface(&mesh.surface, mesh.positions.len())?;
    check_style(style)
}

fn check_camera(camera: &Camera) -> Result<(), MeshError> {
    if camera.width == 0 || camera.height == 0 {
        let size = format!("the image is {} x {}; both must be positive", camera.width, camera.height);
        return MeshError::invalid("camera", size);
    }
    let Camera { focal, principal, rotation, translation, .. } = camera;
    if !(focal.min_element() > 0.0 && focal.is_finite() && principal.is_finite()) {
        return MeshError::invalid("camera", "the focal lengths must be positive and the intrinsics finite");
    }
    if !(rotation.is_finite() && translation.is_finite()) {
        return MeshError::invalid("camera", "its pose is not finite");
    }
    Ok(())
}

fn check_mesh(mesh: &MeshInstance, camera: &Camera) -> Result<(), MeshError> {
    let n = mesh.positions.len();
    if mesh.normals.len() != n {
        let problem = format!("{n} positions but {} normals; give one of each per vertex", mesh.normals.len());
        return MeshError::invalid("vertices", problem);
    }
    if let Some(light_visibility) = mesh.light_visibility {
        if light_visibility.len() != n {
            let problem = format!("{} numbers for {n} vertices; give one each", light_visibility.len());
            return MeshError::invalid("light_visibility", problem);
        }
        if let Some(i) = light_visibility.iter().position(|e| !e.is_finite()) {
            return MeshError::invalid(
                "light_visibility",
                format!("vertex {i} has {}; give finite numbers", light_visibility[i]),
            );
        }
    }
    for (i, position) in mesh.positions.iter().enumerate() {
        let distance = camera.camera_from_world(*position).abs().max_element();
        if !position.is_finite() || !distance.is_finite() {
            return MeshError::invalid("positions", format!("vertex {i} is not finite; check the pose"));
        }
        if distance > FARTHEST {
            let problem =
                format!("vertex {i} is {distance:.1e} m from the camera; give metres, at most {FARTHEST:.0e}");
            return MeshError::invalid("positions", problem);
        }
    }
    if let Some(i) = mesh.normals.iter().position(|v| !v.as_vec3().is_finite()) {
        return MeshError::invalid("normals", format!("the normal of vertex {i} is not finite; check the pose"));
    }
    if mesh.triangles.iter().flatten().any(|&i| i as usize >= n) {
        return MeshError::invalid("triangles", format!("an index is out of range ({n} vertices)"));
    }
    Ok(())
}

fn check_surface(surface: &Surface, vertices: usize) -> Result<(), MeshError> {
    match surface {
        Surface::Texture { uvs, texture: t } => {
            if uvs.len() != vertices {
                return MeshError::invalid("uvs", format!("{} for {vertices} vertices; give one each", uvs.len()));
            }
            if let Some(i) = uvs.iter().position(|uv| !uv.as_vec2().is_finite()) {
                return MeshError::invalid("uvs", format!("the UV of vertex {i} is not finite"));
            }
            if t.width == 0 || t.height == 0 || t.rgb.len() != t.width as usize * t.height as usize {
                let problem = format!("{} x {} does not match its {} texels", t.width, t.height, t.rgb.len());
                return MeshError::invalid("texture", problem);
            }
        }
        Surface::VertexColors(colors) => {
            if colors.len() != vertices {
                let problem = format!("{} for {vertices} vertices; give one each", colors.len());
                return MeshError::invalid("vertex colors", problem);
            }
            if let Some(i) = colors.iter().position(|c| !is_color(*c)) {
                return MeshError::invalid("vertex colors", format!("the color of vertex {i} is not within 0 to 1"));
            }
        }
        Surface::Color(color) if !is_color(*color) => {
            return MeshError::invalid("color", format!("{color} is not within 0 to 1"));
        }
        Surface::Color(_) => {}
    }
    Ok(())
}

fn check_style(style: &MeshStyle) -> Result<(), MeshError> {
    if !(1..=MAX_SUPERSAMPLE).contains(&style.supersample) {
        let problem = format!("{} is outside 1 to {MAX_SUPERSAMPLE}", style.supersample);
        return MeshError::invalid("supersample", problem);
    }
    if let Shading::Lit { ambient, lights, wrap } = &style.shading {
        if lights.len() > MAX_LIGHTS {
            return MeshError::invalid("lights", format!("{} lights; at most {MAX_LIGHTS} are drawn", lights.len()));
        }
        if lights.iter().any(|l| l.direction.try_normalize().is_none()) {
            return MeshError::invalid("lights", "a direction has no length");
        }
        if !(ambient.is_finite() && lights.iter().all(|l| l.color.is_finite())) {
            return MeshError::invalid("lights", "a colour is not finite");
        }
        if !(0.0..=1.0).contains(wrap) {
            return MeshError::invalid("wrap", format!("{wrap} is outside 0 to 1"));
        }
    }
    if let Some(Wireframe { width, color }) = &style.wireframe {
        let [thinnest, widest] = LINE_WIDTHS;
        if !(thinnest..=widest).contains(width) {
            return MeshError::invalid("line width", format!("{width} px is outside {thinnest} to {widest}"));
        }
        if !is_color(*color) {
            return MeshError::invalid("line color", "is not within 0 to 1");
        }
    }
    Ok(())
}

/// Whether all three components are display values; NaN is not.
fn is_color(color: DVec3) -> bool {
    color.to_array().iter().all(|v| (0.0..=1.0).contains(v))
}
