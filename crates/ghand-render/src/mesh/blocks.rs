//! Renders images of meshes in blocks: the samples of a large image would take gigabytes, or exceed the texture size
//! limit.

use ghand_core::Camera;

use super::{MeshError, MeshImage, MeshInstance, MeshRenderer, MeshStyle, Surface, check_input};

/// Largest edge of an image, pixels: the same as for the splatter.
const LARGEST_EDGE: u32 = 16_384;
/// Largest edge of a block, pixels. With 4 x 4 samples of 24 bytes for each pixel a block takes 400 MB.
const LARGEST_BLOCK: u32 = 1024;

impl MeshRenderer {
    /// Draws one image and waits for it.
    ///
    /// # Errors
    /// [`MeshError::Invalid`] if the input is unusable, an edge of the image is longer than 16384 pixels, or a texture
    /// is larger than the device supports; [`MeshError::Device`] if the device fails.
    pub fn render(&self, mesh: &MeshInstance, camera: &Camera, style: &MeshStyle) -> Result<MeshImage, MeshError> {
        let mut whole = None;
        self.render_blocks(mesh, camera, style, |[left, top], block| {
            if [block.width, block.height] == [camera.width, camera.height] {
                whole = Some(block);
                return;
            }
            let whole = whole.get_or_insert_with(|| MeshImage::empty([camera.width, camera.height]));
            whole.place([left, top], &block);
        })?;
        Ok(whole.unwrap_or_else(|| MeshImage::empty([camera.width, camera.height])))
    }

    /// As [`MeshRenderer::render`], but passes the image to `sink` in blocks, row by row, each with its left column and
    /// top row. For images that are converted and need not be held as floats as a whole.
    ///
    /// The pixels of a block equal those of the whole image except for samples within rounding of an edge.
    ///
    /// # Errors
    /// As [`MeshRenderer::render`].
    pub fn render_blocks(
        &self,
        mesh: &MeshInstance,
        camera: &Camera,
        style: &MeshStyle,
        sink: impl FnMut([u32; 2], MeshImage),
    ) -> Result<(), MeshError> {
        check_input(mesh, camera, style)?;
        let largest = self.context.device.limits().max_texture_dimension_2d;
        if let Surface::Texture { texture, .. } = mesh.surface
            && texture.width.max(texture.height) > largest
        {
            let problem = format!("{} x {} texels; this device supports {largest}", texture.width, texture.height);
            return MeshError::invalid("texture", problem);
        }
        if camera.width.max(camera.height) > LARGEST_EDGE {
            let problem = format!("{} x {} pixels; at most {LARGEST_EDGE} are drawn", camera.width, camera.height);
            return MeshError::invalid("size", problem);
        }
        self.draw_blocks(mesh, camera, style, self.largest_block(style).min(LARGEST_BLOCK), sink)
    }

    /// Largest edge of an image that the device's textures can hold with its samples and margin, pixels. At least 2030
    /// on any device: WebGPU guarantees textures of 8192 samples, and a margin is at most 9 pixels.
    pub(super) fn largest_block(&self, style: &MeshStyle) -> u32 {
        let margin = style.wireframe.map_or(0, |w| w.margin());
        let largest = self.context.device.limits().max_texture_dimension_2d;
        (largest / style.supersample).saturating_sub(2 * margin).max(1)
    }

    /// Draws validated input in blocks of at most `edge` x `edge` pixels.
    fn draw_blocks(
        &self,
        mesh: &MeshInstance,
        camera: &Camera,
        style: &MeshStyle,
        edge: u32,
        mut sink: impl FnMut([u32; 2], MeshImage),
    ) -> Result<(), MeshError> {
        let starts = |size: u32| (0..size).step_by(edge as usize);
        for (top, left) in starts(camera.height).flat_map(|top| starts(camera.width).map(move |left| (top, left))) {
            let size = [(camera.width - left).min(edge), (camera.height - top).min(edge)];
            let block = camera.cropped(left as i32, top as i32, size[0], size[1]);
            sink([left, top], self.render_block(mesh, &block, style)?);
        }
        Ok(())
    }
}

impl MeshImage {
    /// An empty image.
    fn empty([width, height]: [u32; 2]) -> MeshImage {
        let pixels = width as usize * height as usize;
        MeshImage { width, height, rgba: vec![[0.0; 4]; pixels], depth: vec![f32::INFINITY; pixels] }
    }

    /// Copies a block into this image; it must be inside.
    fn place(&mut self, [left, top]: [u32; 2], block: &MeshImage) {
        let width = block.width as usize;
        for row in 0..block.height as usize {
            let from = row * width..(row + 1) * width;
            let start = (top as usize + row) * self.width as usize + left as usize;
            self.rgba[start..start + width].copy_from_slice(&block.rgba[from.clone()]);
            self.depth[start..start + width].copy_from_slice(&block.depth[from]);
        }
    }
}
