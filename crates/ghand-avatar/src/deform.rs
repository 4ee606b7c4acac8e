//! Deforms a hand: from the properties of its Gaussians and a pose to posed Gaussians, and the gradients back
//! (paper eq. 7 to 11).
//!
//! skeleton -> (the property model) -> blend_shapes -> residual_skeleton -> skin -> stretch -> shade; the backward pass runs in
//! the opposite order. A [`baked`] hand has one stage after the skeleton instead, and no backward pass. Each stage has a
//! file, named like its shaders and its twin in `ghand-core`. All tables are joint- or component-major (`[rows][N]`), so
//! that neighbouring invocations access neighbouring words.

pub mod baked;
mod blend_shapes;
mod joint_sums;
mod normals;
mod properties;
mod residual_skeleton;
mod shade;
mod skeleton;
mod skin;
mod stretch;
mod weight_table;

use bytemuck::{Pod, Zeroable};

pub use ghand_core::blend_shapes::CoefficientLayout;
pub use joint_sums::{JointSums, SumUniforms};
pub use properties::{Properties, PropertySizes};
pub use weight_table::{BLOCK, invocations_of_four, weight_table};

use baked::{Baked, BakedTables};
use blend_shapes::{BlendShapes, BlendShapesBackward};
use ghand_render::pipeline::compute_pass;
use ghand_render::splat::{Shape, SplatModel};
use ghand_render::{Gpu, RenderError, buffers};
use normals::Normals;
use residual_skeleton::{ResidualSkeleton, ResidualSkeletonBackward};
use shade::{Shade, ShadeBackward};
use skeleton::{Skeleton, SkeletonBackward};
use skin::{Skin, SkinBackward};
use stretch::{Stretch, StretchBackward};

/// Floats of one joint in a chain, as in `shaders/shared/pose.wgsl`.
pub const CHAIN_STRIDE: usize = 33;
/// Rows of the table of offsets and points.
const OFFSET_ROWS: usize = 6;
/// Rows of the table of skinning gradients.
const SKIN_GRADIENT_ROWS: usize = 15;
/// First row of the moments in that table, as in `shaders/shared/pose.wgsl`, and their number.
pub const ROW_MOMENT: u32 = 3;
const MOMENT_ROWS: usize = 12;

/// See `shaders/shared/pose.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct PoseUniforms {
    /// N.
    pub gaussian_count: u32,
    /// `n_b`.
    pub joint_count: u32,
    /// n.
    pub basis_count: u32,
    /// Offset of the frame's pose in the poses, floats.
    pub pose_offset: u32,
    /// Whether the residual skeleton is anchored at the rest joints.
    pub anchored: u32,
    /// Whether the mean over joints is subtracted from the residual weights.
    pub zero_sum: u32,
    /// Number of columns of the splatter's table.
    pub table_columns: u32,
    /// The hand's first column in it.
    pub table_first: u32,
}

/// The hand to be deformed.
#[derive(Debug, Clone, Copy)]
pub struct DeformTemplate<'a> {
    /// Rest positions, `[3][N]`, metres.
    pub rest: &'a [f32],
    /// Skinning weights, `[n_b][N]`.
    pub weights: &'a [f32],
    /// Rest normals, `[3][N]`, unit length, if shading or flat Gaussians need posed ones.
    pub normals: Option<&'a [f32]>,
    /// Neighbours of each Gaussian, `[any number][N]`; a missing one is the Gaussian itself.
    pub neighbors: &'a [u32],
    /// Rest joints, `[n_b][3]`, metres.
    pub joints: &'a [f32],
    /// Parent of each joint, -1 for the root.
    pub parents: &'a [i32],
    /// Number of shape bases, n.
    pub basis_count: usize,
    /// Layout of the blend coefficients.
    pub coefficients: CoefficientLayout,
    /// Number of poses in the pose table.
    pub frames: usize,
    /// Whether skinning is plain: there are no residual weights, no regressor and no residual skeleton.
    pub plain_skinning: bool,
    /// Whether the residual skeleton is anchored at the rest joints.
    pub anchored: bool,
    /// Whether the mean over joints is subtracted from the residual weights.
    pub zero_sum: bool,
    /// Where the Gaussians lie on a mesh whose vertices have shades, if light is apart from skin.
    pub lit_surface: Option<LitSurface<'a>>,
}

/// Where the Gaussians of a hand lie on its mesh.
#[derive(Debug, Clone, Copy)]
pub struct LitSurface<'a> {
    /// Number of the mesh's vertices, V.
    pub vertex_count: usize,
    /// Vertices of each Gaussian's triangle, N.
    pub corners: &'a [[u32; 3]],
    /// Barycentric coordinates on it, N.
    pub barycentric: &'a [[f32; 3]],
    /// Whether the vertices have gloss beside their shades.
    pub glossy: bool,
}

/// The position of a hand's Gaussians in a splatter's table, `[rows][columns]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TablePlace {
    /// Number of columns of the table: all Gaussians of the scene.
    pub columns: usize,
    /// The hand's first column.
    pub first: usize,
    /// Sizes of the table's Gaussians, isotropic or flat.
    pub shape: Shape,
}

impl TablePlace {
    /// First row of the colours.
    fn color_row(self) -> u64 {
        SplatModel { shape: self.shape, ..SplatModel::HAND }.color_row() as u64
    }

    /// Byte offset of the hand's first number in a row.
    fn byte(self, row: u64) -> u64 {
        (row * self.columns as u64 + self.first as u64) * size_of::<f32>() as u64
    }
}

/// Number of floats of a pose of `joint_count` joints: one rotation per joint, and the translation.
pub fn pose_stride(joint_count: usize) -> usize {
    3 * joint_count + 3
}

/// Every buffer of the forward stages.
struct ForwardBuffers {
    pose: wgpu::Buffer,
    poses: wgpu::Buffer,
    rest: wgpu::Buffer,
    weights: wgpu::Buffer,
    joints: wgpu::Buffer,
    parents: wgpu::Buffer,
    chain: wgpu::Buffer,
    residual_joints: wgpu::Buffer,
    residual_chain: wgpu::Buffer,
    offsets: wgpu::Buffer,
    skinned: wgpu::Buffer,
    properties: Properties,
    gaussians: wgpu::Buffer,
}

/// A hand's deformation: poses and properties to Gaussians in a splatter's table.
pub struct Deformation {
    buffers: ForwardBuffers,
    current: PoseUniforms,
    place: TablePlace,
    skeleton: Skeleton,
    posing: Posing,
    shade: Option<Shade>,
}

/// From properties to posed Gaussians.
struct PropertyStages {
    blend_shapes: BlendShapes,
    residual_skeleton: Option<ResidualSkeleton>,
    skin: Skin,
    stretch: Stretch,
    normals: Option<Normals>,
}

/// What poses the Gaussians once the skeleton is posed.
enum Posing {
    /// From the properties that a property model fills.
    Properties(Box<PropertyStages>),
    /// From tables.
    Baked(Baked),
}

/// The skeleton of a baked hand, and its light.
#[derive(Debug, Clone, Copy)]
pub struct BakedTemplate<'a> {
    /// Rest joints, `[n_b][3]`, metres.
    pub joints: &'a [f32],
    /// Parent of each joint, -1 for the root.
    pub parents: &'a [i32],
    /// Number of poses in the pose table.
    pub frames: usize,
    /// Where the Gaussians lie on a mesh whose vertices have shades, if light is apart from skin.
    pub lit_surface: Option<LitSurface<'a>>,
}

impl Deformation {
    /// A deformation that fills the rows of mean, standard deviation, normal (if flat) and colour at `place` in
    /// `gaussians`, the table of a splatter with plain colours. A hand without normals is round among flat Gaussians.
    pub fn new(gpu: &Gpu, template: &DeformTemplate, gaussians: &wgpu::Buffer, place: TablePlace) -> Deformation {
        let joints = template.parents.len();
        let count = template.rest.len() / 3;
        let current = PoseUniforms {
            gaussian_count: count as u32,
            joint_count: joints as u32,
            basis_count: template.basis_count as u32,
            pose_offset: 0,
            anchored: template.anchored.into(),
            zero_sum: template.zero_sum.into(),
            table_columns: place.columns as u32,
            table_first: place.first as u32,
        };
        let sizes = PropertySizes {
            gaussians: count,
            joints,
            bases: template.basis_count,
            coefficients: template.coefficients,
            plain_skinning: template.plain_skinning,
        };
        let buffers = ForwardBuffers {
            pose: buffers::uniform(gpu, "pose", &current),
            poses: buffers::zeroed(gpu, "poses", template.frames * pose_stride(joints)),
            rest: buffers::filled(gpu, "rest", template.rest),
            weights: buffers::filled(gpu, "weights", &weight_table(template.weights, joints)),
            joints: buffers::filled(gpu, "joints", template.joints),
            parents: buffers::filled(gpu, "parents", template.parents),
            chain: buffers::zeroed(gpu, "chain", CHAIN_STRIDE * joints),
            residual_joints: buffers::zeroed(gpu, "residual joints", 3 * joints),
            residual_chain: buffers::zeroed(gpu, "residual chain", CHAIN_STRIDE * joints),
            offsets: buffers::zeroed(gpu, "offsets", OFFSET_ROWS * count),
            skinned: buffers::zeroed(gpu, "skinned points", 3 * count),
            properties: Properties::zeroed(gpu, sizes),
            gaussians: gaussians.clone(),
        };
        Deformation {
            skeleton: Skeleton::new(gpu, &buffers),
            posing: Posing::Properties(Box::new(PropertyStages {
                blend_shapes: BlendShapes::new(gpu, &buffers),
                residual_skeleton: (!template.plain_skinning).then(|| ResidualSkeleton::new(gpu, &buffers)),
                skin: Skin::new(gpu, &buffers),
                stretch: Stretch::new(gpu, &buffers, template.neighbors),
                normals: template.normals.map(|normals| Normals::new(gpu, &buffers, normals)),
            })),
            shade: template
                .lit_surface
                .map(|surface| Shade::new(gpu, &buffers, &surface, place.color_row(), template.frames)),
            buffers,
            current,
            place,
        }
    }

    /// As [`Deformation::new`] for a baked hand, from valid tables. Of its properties only the colours have a buffer, and
    /// only if light is apart from them; offsets, weights, the residual skeleton and the backward pass do not exist.
    pub fn baked(
        gpu: &Gpu,
        template: &BakedTemplate,
        tables: &BakedTables,
        gaussians: &wgpu::Buffer,
        place: TablePlace,
    ) -> Deformation {
        let joints = template.parents.len();
        let current = PoseUniforms {
            gaussian_count: tables.count as u32,
            joint_count: joints as u32,
            basis_count: 0,
            pose_offset: 0,
            anchored: 0,
            zero_sum: 0,
            table_columns: place.columns as u32,
            table_first: place.first as u32,
        };
        let lit = template.lit_surface.is_some();
        let none = |name: &str| buffers::zeroed(gpu, name, 0);
        let buffers = ForwardBuffers {
            pose: buffers::uniform(gpu, "pose", &current),
            poses: buffers::zeroed(gpu, "poses", template.frames * pose_stride(joints)),
            rest: none("rest"),
            weights: none("weights"),
            joints: buffers::filled(gpu, "joints", template.joints),
            parents: buffers::filled(gpu, "parents", template.parents),
            chain: buffers::zeroed(gpu, "chain", CHAIN_STRIDE * joints),
            residual_joints: none("residual joints"),
            residual_chain: none("residual chain"),
            offsets: none("offsets"),
            skinned: none("skinned points"),
            properties: Properties::colors(gpu, tables.count, joints, lit),
            gaussians: gaussians.clone(),
        };
        Deformation {
            skeleton: Skeleton::new(gpu, &buffers),
            posing: Posing::Baked(Baked::new(gpu, &buffers, tables, place, lit)),
            shade: template
                .lit_surface
                .map(|surface| Shade::new(gpu, &buffers, &surface, place.color_row(), template.frames)),
            buffers,
            current,
            place,
        }
    }

    /// The properties, which a property model fills.
    pub fn properties(&self) -> &Properties {
        &self.buffers.properties
    }

    /// The uniforms, for stages of a property model.
    pub fn uniforms(&self) -> &wgpu::Buffer {
        &self.buffers.pose
    }

    /// The posed joint chain, see `shaders/shared/pose.wgsl`. Property models can read it.
    pub fn chain(&self) -> &wgpu::Buffer {
        &self.buffers.chain
    }

    /// Residual joints, `[n_b][3]`, metres, and their posed chain.
    pub fn residual_chain(&self) -> [&wgpu::Buffer; 2] {
        [&self.buffers.residual_joints, &self.buffers.residual_chain]
    }

    /// Offsets Delta, then points x_c + Delta, `[6][N]`, metres.
    pub fn offsets(&self) -> &wgpu::Buffer {
        &self.buffers.offsets
    }

    /// Skinning weights, `[n_b][N]`, and behind them the lists of [`weight_table`].
    pub fn weights(&self) -> &wgpu::Buffer {
        &self.buffers.weights
    }

    /// Normals of the skinned surface, `[3][N]`, unit length or zero where skinning collapses the surface; `None` if the
    /// template has no normals, or the hand is baked.
    pub fn normals(&self) -> Option<&wgpu::Buffer> {
        match &self.posing {
            Posing::Properties(stages) => stages.normals.as_ref().map(|stage| &stage.normals),
            Posing::Baked(_) => None,
        }
    }

    /// Rest joints, `[n_b][3]`, metres.
    pub fn joints(&self) -> &wgpu::Buffer {
        &self.buffers.joints
    }

    /// Poses, `[frames][n_b * 3 + 3]`: axis-angles, then the translation.
    pub fn poses(&self) -> &wgpu::Buffer {
        &self.buffers.poses
    }

    /// Reads back the pose of the frame, `[n_b * 3 + 3]`; waits for the device.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn read_pose(&self, gpu: &Gpu) -> Result<Vec<f32>, RenderError> {
        let stride = pose_stride(self.current.joint_count as usize);
        buffers::read_from(gpu, &self.buffers.poses, self.current.pose_offset as usize, stride)
    }

    /// Sets the shades of a frame, one RGB per vertex of the mesh: factors on the colours. They are 1 before.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the hand has no mesh with shades, or another number of vertices or frames.
    pub fn set_shades(&self, gpu: &Gpu, frame: usize, shades: &[[f32; 3]]) -> Result<(), RenderError> {
        let shade =
            self.shade.as_ref().ok_or_else(|| RenderError::Invalid("shades for a hand without light".into()))?;
        shade.set(gpu, frame, shades)
    }

    /// Sets the gloss of the frame and view that are drawn next, one RGB per vertex of the mesh, linear light: it is added
    /// to what the shaded skin shows. It is 0 before.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the hand has no gloss, or another number of vertices.
    pub fn set_gloss(&self, gpu: &Gpu, gloss: &[[f32; 3]]) -> Result<(), RenderError> {
        let shade = self.shade.as_ref().ok_or_else(|| RenderError::Invalid("gloss for a hand without light".into()))?;
        shade.set_gloss(gpu, gloss)
    }

    /// Sets the frame whose pose later submissions use.
    pub fn set_frame(&mut self, gpu: &Gpu, frame: usize) {
        self.current.pose_offset = (frame * pose_stride(self.current.joint_count as usize)) as u32;
        gpu.queue.write_buffer(&self.buffers.pose, 0, bytemuck::bytes_of(&self.current));
    }

    /// Encodes the skeleton stage, whose chain a property model can read.
    pub fn encode_skeleton(&self, encoder: &mut wgpu::CommandEncoder) {
        self.skeleton.encode(&mut compute_pass(encoder, "skeleton"));
    }

    /// Encodes the stages after the property model.
    pub fn encode_skin(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = compute_pass(encoder, "deform");
        match &self.posing {
            Posing::Properties(stages) => {
                stages.blend_shapes.encode(&mut pass);
                if let Some(residual_skeleton) = &stages.residual_skeleton {
                    residual_skeleton.encode(&mut pass);
                }
                stages.skin.encode(&mut pass);
                stages.stretch.encode(&mut pass);
            }
            Posing::Baked(baked) => baked.encode(&mut pass),
        }
        if let Some(shade) = &self.shade {
            shade.encode(&mut pass);
        }
        // A baked hand's stage writes to the table itself.
        let Posing::Properties(stages) = &self.posing else { return };
        if let Some(normals) = &stages.normals {
            normals.encode(&mut pass);
        }
        drop(pass);
        let p = &self.buffers.properties;
        let row = row_bytes(&self.current);
        if let Some(normals) = self.normals().filter(|_| self.place.shape == Shape::Flat) {
            for c in 0..3 {
                let to = self.place.byte(SplatModel::SCALE_ROW as u64 + 1 + c);
                encoder.copy_buffer_to_buffer(normals, c * row, &self.buffers.gaussians, to, row);
            }
        }
        if self.shade.is_none() {
            for c in 0..3 {
                let to = self.place.byte(self.place.color_row() + c);
                encoder.copy_buffer_to_buffer(&p.color, c * row, &self.buffers.gaussians, to, row);
            }
        }
    }
}

/// Bytes of a row of N floats.
fn row_bytes(uniforms: &PoseUniforms) -> u64 {
    u64::from(uniforms.gaussian_count) * size_of::<f32>() as u64
}

/// The additional buffers of the backward stages.
struct BackwardBuffers {
    d_gaussians: wgpu::Buffer,
    d_skin: wgpu::Buffer,
    d_residual_joints: wgpu::Buffer,
    d_joints: wgpu::Buffer,
    d_local: wgpu::Buffer,
    d_pose: wgpu::Buffer,
    mobility: wgpu::Buffer,
    gradients: Properties,
}

/// The backward pass of a [`Deformation`]. In this order: [`DeformationBackward::encode_point_gradients`], penalties on offsets
/// and properties, [`DeformationBackward::encode_property_gradients`], the property model's backward pass, which adds to
/// [`DeformationBackward::d_local`], and [`DeformationBackward::encode_pose_gradient`].
pub struct DeformationBackward {
    buffers: BackwardBuffers,
    place: TablePlace,
    row_bytes: u64,
    skin: SkinBackward,
    stretch: StretchBackward,
    shade: Option<ShadeBackward>,
    residual_skeleton: Option<ResidualSkeletonBackward>,
    blend_shapes: BlendShapesBackward,
    skeleton: SkeletonBackward,
}

impl DeformationBackward {
    /// The backward pass of `forward`; `d_gaussians` is the gradient of the table of Gaussians. `mobility` is 1 for
    /// each joint whose rotation gets a gradient, else 0.
    pub fn new(gpu: &Gpu, forward: &Deformation, d_gaussians: &wgpu::Buffer, mobility: &[f32]) -> DeformationBackward {
        let b = &forward.buffers;
        let sizes = b.properties.sizes;
        let d = BackwardBuffers {
            d_gaussians: d_gaussians.clone(),
            d_skin: buffers::zeroed(gpu, "d_skin", SKIN_GRADIENT_ROWS * sizes.gaussians),
            d_residual_joints: buffers::zeroed(gpu, "d_residual_joints", 3 * sizes.joints),
            d_joints: buffers::zeroed(gpu, "d_joints", 3 * sizes.joints),
            d_local: buffers::zeroed(gpu, "d_local", 9 * sizes.joints),
            d_pose: buffers::zeroed(gpu, "d_pose", pose_stride(sizes.joints)),
            mobility: buffers::filled(gpu, "mobility", mobility),
            gradients: Properties::zeroed(gpu, sizes),
        };
        DeformationBackward {
            skin: SkinBackward::new(gpu, b, &d),
            stretch: StretchBackward::new(gpu, b, &d),
            shade: forward.shade.as_ref().map(|shade| ShadeBackward::new(gpu, shade, b, &d)),
            residual_skeleton: (!sizes.plain_skinning).then(|| ResidualSkeletonBackward::new(gpu, b, &d)),
            blend_shapes: BlendShapesBackward::new(gpu, b, &d),
            skeleton: SkeletonBackward::new(gpu, b, &d),
            place: forward.place,
            row_bytes: row_bytes(&forward.current),
            buffers: d,
        }
    }

    /// Gradients of the properties, with the same shapes.
    pub fn gradients(&self) -> &Properties {
        &self.buffers.gradients
    }

    /// dL/d(pose) of the frame, `[n_b * 3 + 3]`.
    pub fn d_pose(&self) -> &wgpu::Buffer {
        &self.buffers.d_pose
    }

    /// dL/d(rest joints), `[n_b][3]`.
    pub fn d_joints(&self) -> &wgpu::Buffer {
        &self.buffers.d_joints
    }

    /// dL/d(local rotations), `[n_b][9]`, row-major. A property model that depends on the pose adds its part between
    /// [`DeformationBackward::encode_property_gradients`] and [`DeformationBackward::encode_pose_gradient`].
    pub fn d_local(&self) -> &wgpu::Buffer {
        &self.buffers.d_local
    }

    /// Its first three rows are dL/d(offset), `[3][N]`, between [`DeformationBackward::encode_point_gradients`] and
    /// [`DeformationBackward::encode_property_gradients`]: penalties on the offsets are added there.
    pub fn d_offsets(&self) -> &wgpu::Buffer {
        &self.buffers.d_skin
    }

    /// Encodes the gradients from the table of Gaussians to scale, colour, residual weights and points.
    pub fn encode_point_gradients(&self, encoder: &mut wgpu::CommandEncoder) {
        let b = &self.buffers;
        let g = &self.buffers.gradients;
        let row = self.row_bytes;
        if self.shade.is_none() {
            for c in 0..3 {
                let from = self.place.byte(self.place.color_row() + c);
                encoder.copy_buffer_to_buffer(&b.d_gaussians, from, &g.color, c * row, row);
            }
        }
        let mut pass = compute_pass(encoder, "deform backward");
        if let Some(shade) = &self.shade {
            shade.encode(&mut pass);
        }
        self.stretch.encode(&mut pass);
        self.skin.encode(&mut pass);
    }

    /// Encodes the gradients from the points to all other properties, and the residual skeleton's part of the local
    /// rotations' gradient.
    pub fn encode_property_gradients(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.residual_skeleton.is_none() {
            encoder.clear_buffer(&self.buffers.d_local, 0, None);
        }
        let mut pass = compute_pass(encoder, "property gradients");
        if let Some(residual_skeleton) = &self.residual_skeleton {
            residual_skeleton.encode(&mut pass);
        }
        self.blend_shapes.encode(&mut pass);
    }

    /// Encodes the gradients of pose and rest joints.
    pub fn encode_pose_gradient(&self, encoder: &mut wgpu::CommandEncoder) {
        self.skeleton.encode(&mut compute_pass(encoder, "pose gradient"));
    }
}
