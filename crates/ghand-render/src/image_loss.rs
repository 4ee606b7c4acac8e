//! Host part of `image_loss.wgsl`: L1 and SSIM between the splatted image and an 8-bit target.

use bytemuck::{Pod, Zeroable};

use crate::pipeline::{Bound, Module, compute_pass};
use crate::stages::{
    BlurColumns, BlurColumnsBindings, BlurRows, BlurRowsBindings, DBlurRows, DBlurRowsBindings, LossSums,
    LossSumsBindings,
};
use crate::{Gpu, RenderError, buffers};

/// Number of strands (partial sums) of the loss value, as in the shader.
const STRANDS: usize = 256;
/// Outputs of an invocation that walks along a row, as in the shader.
pub(crate) const ROW_STRIP: u32 = 54;
/// Of one that walks along a column.
pub(crate) const COLUMN_STRIP: u32 = 84;

/// See `shaders/image_loss.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LossUniforms {
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Weight of mean |x - y|.
    pub l1_weight: f32,
    /// Weight of 1 - mean SSIM.
    pub ssim_weight: f32,
    /// One over the number of values in the means.
    pub inverse_count: f32,
    /// Number of values that are summed.
    pub summands: u32,
    /// Unused.
    pub padding: [u32; 2],
}

/// The weights of the loss `l1 mean |x - y| + ssim (1 - mean SSIM)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LossWeights {
    /// Weight of the absolute error.
    pub l1: f32,
    /// Weight of 1 - SSIM (11x11 Gaussian window, sigma 1.5, zeros outside the image).
    pub ssim: f32,
}

/// Value of the loss over the pixels of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LossValue {
    /// Sum of |x - y| over pixels and channels.
    pub l1_sum: f64,
    /// Sum of SSIM over pixels and channels.
    pub ssim_sum: f64,
}

/// The loss stages, bound to a splatter's image and gradient.
pub struct ImageLoss {
    uniforms: wgpu::Buffer,
    target: wgpu::Buffer,
    strand_sums: wgpu::Buffer,
    blur_rows: Bound,
    blur_columns: Bound,
    d_blur_rows: Bound,
    sums: Bound,
    max_pixels: usize,
    size: [u32; 2],
}

/// Invocations for the strips of an image's rows and of its columns.
fn strips([width, height]: [u32; 2]) -> [u32; 2] {
    [height * width.div_ceil(ROW_STRIP), width * height.div_ceil(COLUMN_STRIP)]
}

/// Bytes per pixel of the largest of its buffers.
const BYTES_PER_PIXEL: u64 = 4 * 3 * 4;

impl ImageLoss {
    /// Most pixels of an image on a device.
    pub fn most_pixels(gpu: &Gpu) -> u64 {
        let limits = gpu.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / BYTES_PER_PIXEL
    }

    /// A loss that reads `image` and writes `d_image` (one `vec4` per pixel each) for images of at most `max_pixels`.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory or was lost.
    pub fn new(
        gpu: &Gpu,
        image: &wgpu::Buffer,
        d_image: &wgpu::Buffer,
        max_pixels: usize,
    ) -> Result<ImageLoss, RenderError> {
        let what = format!("the loss of images up to {max_pixels} pixels");
        gpu.scoped(&what, || ImageLoss::make(gpu, image, d_image, max_pixels))
    }

    fn make(gpu: &Gpu, image: &wgpu::Buffer, d_image: &wgpu::Buffer, max_pixels: usize) -> ImageLoss {
        let module = Module::new(gpu, "image_loss");
        let uniforms = buffers::uniform(gpu, "loss", &LossUniforms::zeroed());
        let target = buffers::zeroed(gpu, "target", max_pixels);
        let rows = &buffers::zeroed(gpu, "loss rows", 3 * 4 * max_pixels);
        let columns = &buffers::zeroed(gpu, "loss columns", 3 * 4 * max_pixels);
        // A strip has at least one pixel, and each pixel belongs to one of a row and one of a column.
        let values = &buffers::zeroed(gpu, "loss values", 2 * 2 * max_pixels);
        let strand_sums = buffers::zeroed(gpu, "loss sums", 2 * STRANDS);
        let loss = &uniforms;
        let target_image = &target;
        ImageLoss {
            blur_rows: module
                .stage::<BlurRows>(gpu, &[])
                .bind(gpu, &BlurRowsBindings { loss, image, target_image, rows }),
            blur_columns: module
                .stage::<BlurColumns>(gpu, &[])
                .bind(gpu, &BlurColumnsBindings { loss, rows, columns, values }),
            d_blur_rows: module
                .stage::<DBlurRows>(gpu, &[])
                .bind(gpu, &DBlurRowsBindings { loss, image, target_image, columns, values, d_image }),
            sums: module
                .stage::<LossSums>(gpu, &[])
                .bind(gpu, &LossSumsBindings { loss, values, strand_sums: &strand_sums }),
            uniforms,
            target,
            strand_sums,
            max_pixels,
            size: [0, 0],
        }
    }

    /// Sets the target and the weights of later passes. `pixels` holds the target's bytes (red, green, blue, and one
    /// that does not count) row by row; the means are over `value_count` values.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the target has the wrong length or is too large.
    pub fn set_target(
        &mut self,
        gpu: &Gpu,
        size: [u32; 2],
        pixels: &[[u8; 4]],
        weights: LossWeights,
        value_count: f64,
    ) -> Result<(), RenderError> {
        let count = size[0] as usize * size[1] as usize;
        if pixels.len() != count || count > self.max_pixels || count == 0 {
            return Err(RenderError::Invalid(format!(
                "a target of {} x {} pixels with {} values, but the loss is for at most {} pixels",
                size[0],
                size[1],
                pixels.len(),
                self.max_pixels
            )));
        }
        let uniforms = LossUniforms {
            size,
            l1_weight: weights.l1,
            ssim_weight: weights.ssim,
            inverse_count: (1.0 / value_count) as f32,
            summands: strips(size).iter().sum(),
            padding: [0; 2],
        };
        gpu.queue.write_buffer(&self.uniforms, 0, bytemuck::bytes_of(&uniforms));
        gpu.queue.write_buffer(&self.target, 0, bytemuck::cast_slice(pixels));
        self.size = size;
        Ok(())
    }

    /// Encodes the loss and its gradient with respect to the image.
    pub fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = compute_pass(encoder, "loss");
        let [along_rows, along_columns] = strips(self.size);
        self.blur_rows.dispatch_invocations(&mut pass, along_rows);
        self.blur_columns.dispatch_invocations(&mut pass, along_columns);
        self.d_blur_rows.dispatch_invocations(&mut pass, along_rows);
        self.sums.dispatch_invocations(&mut pass, STRANDS as u32);
    }

    /// The value of the last loss that ran.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn value(&self, gpu: &Gpu) -> Result<LossValue, RenderError> {
        let sums: Vec<[f32; 2]> = buffers::read(gpu, &self.strand_sums, STRANDS)?;
        let total = |i: usize| sums.iter().map(|s| f64::from(s[i])).sum();
        Ok(LossValue { l1_sum: total(0), ssim_sum: total(1) })
    }
}
