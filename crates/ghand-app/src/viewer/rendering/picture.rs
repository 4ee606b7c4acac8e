//! The subject's picture as a texture, rendered without waiting for it.

use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Instant;

use ghand_render::splat::Counters;
use ghand_render::texture_pass::{self, TexturePass};
use ghand_render::timing::FrameClock;
use ghand_render::{Gpu, RenderError};

use crate::viewer::rendering::drawing::{Drawing, GaussianColors};
use crate::viewer::rendering::frame::{Median, PictureInputs, STAGES, StageTimes};
use crate::viewer::rendering::frame_times::FrameTimes;

/// Format of the texture: display values, as the user interface expects.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Bytes of the counters.
const COUNTER_BYTES: u64 = size_of::<Counters>() as u64;
/// Data read back from a frame: the counters, then the clock.
const READ_BACK_BYTES: u64 = COUNTER_BYTES + FrameClock::bytes(STAGES.len() as u32);

/// The state of the last picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It is being rendered.
    Busy,
    /// It is complete, or there is none yet.
    Complete,
    /// There was too little memory for its tile intersections. There is enough now, and it must be rendered again.
    Incomplete,
    /// The device cannot hold that many tile intersections; fewer pixels need fewer.
    TooFine,
}

struct Pending {
    done: Receiver<Result<Instant, wgpu::BufferAsyncError>>,
    started: Instant,
}

struct Target {
    view: wgpu::TextureView,
    texture: wgpu::Texture,
}

/// A subject on the device, with the texture that shows it.
pub struct Picture {
    /// The subject. It may be drawn beside the texture while no picture is [`Progress::Busy`].
    pub drawing: Drawing,
    /// The colours of Gaussians in the next picture; once it is rendered, in the last one.
    pub colors: GaussianColors,
    pass: TexturePass,
    read_back: wgpu::Buffer,
    clock: Option<FrameClock>,
    target: Option<Target>,
    pending: Option<Pending>,
    frame_ms: Median,
    times: FrameTimes,
    last_ms: f64,
    intersections: u32,
    broken: u32,
}

impl Picture {
    /// The picture of a subject on the device.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold it.
    pub fn new(gpu: &Gpu, drawing: Drawing) -> Result<Picture, RenderError> {
        let pass =
            TexturePass::new(gpu, texture_pass::Target { replace: true, ..texture_pass::Target::color(FORMAT) })?;
        gpu.scoped("the viewer's picture", || Picture::make(gpu, drawing, pass))
    }

    fn make(gpu: &Gpu, drawing: Drawing, pass: TexturePass) -> Picture {
        let read_back = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture read back"),
            size: READ_BACK_BYTES,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let target = None;
        let pending = None;
        let frame_ms = Median::default();
        let intersections = 0;
        let broken = 0;
        Picture {
            drawing,
            colors: GaussianColors::Own,
            pass,
            read_back,
            clock: FrameClock::new(gpu, STAGES.len() as u32),
            target,
            pending,
            frame_ms,
            times: FrameTimes::default(),
            last_ms: 0.0,
            intersections,
            broken,
        }
    }

    /// What the subject consists of, and how many.
    pub fn subject_size(&self) -> (&'static str, usize) {
        self.drawing.size()
    }

    /// Number of tile intersections that the last picture needed.
    pub fn intersections(&self) -> u32 {
        self.intersections
    }

    /// Number of Gaussians that were skipped because they have numbers that are not finite.
    pub fn broken(&self) -> u32 {
        self.broken
    }

    /// The device's time per picture, milliseconds: median of the last 60.
    pub fn frame_ms(&self) -> Option<f64> {
        self.frame_ms.get()
    }

    /// Whether a picture is being rendered.
    pub fn is_busy(&self) -> bool {
        self.pending.is_some()
    }

    /// Forgets the times so far.
    pub fn clear_times(&mut self) {
        self.frame_ms.clear();
        self.times.clear();
    }

    /// The times of the last pictures by stage.
    pub fn times(&self) -> &FrameTimes {
        &self.times
    }

    /// The device's time of the last picture, milliseconds.
    pub fn last_ms(&self) -> f64 {
        self.last_ms
    }

    /// The texture, once a picture has been rendered.
    pub fn texture(&self) -> Option<&wgpu::Texture> {
        self.target.as_ref().map(|t| &t.texture)
    }

    /// The texture's view. It changes with the picture's size.
    pub fn view(&self) -> Option<&wgpu::TextureView> {
        self.target.as_ref().map(|t| &t.view)
    }

    /// Submits the rendering of a picture; later submissions see it in the texture. The previous picture must not be
    /// [`Progress::Busy`]. Returns whether the texture is a new one.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the pose or the size does not fit.
    pub fn render(&mut self, gpu: &Gpu, shot: &PictureInputs) -> Result<bool, RenderError> {
        let (width, height) = (shot.camera.width, shot.camera.height);
        let renewed = self.texture().is_none_or(|t| (t.width(), t.height()) != (width, height));
        if renewed {
            self.target = None;
        }
        let target = match self.target.take() {
            Some(target) => target,
            None => gpu.scoped(&format!("a picture of {width} x {height} pixels"), || target(gpu, width, height))?,
        };
        let view = self.target.insert(target).view.clone();

        let started = Instant::now();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        if let Some(clock) = &self.clock {
            clock.start(&mut encoder);
        }
        let layer = self.drawing.encode(gpu, &mut encoder, shot, &self.colors, self.clock.as_ref())?;
        let image = self.pass.image_layer(gpu, &layer.image, &layer.image);
        self.pass.set_place(gpu, &image, layer.origin, layer.size, shot.background);
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("picture"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                timestamp_writes: self.clock.as_ref().map(FrameClock::end),
                ..Default::default()
            });
            self.pass.draw(&mut pass, &image);
        }
        if let Some(counters) = self.drawing.counters() {
            encoder.copy_buffer_to_buffer(counters, 0, &self.read_back, 0, COUNTER_BYTES);
        }
        if let Some(clock) = &self.clock {
            clock.finish(&mut encoder, &self.read_back, COUNTER_BYTES);
        }
        gpu.queue.submit([encoder.finish()]);
        let (sender, done) = channel();
        self.read_back.map_async(wgpu::MapMode::Read, .., move |result| {
            // A closed channel means that the picture and the receiver no longer exist.
            let _ = sender.send(result.map(|()| Instant::now()));
        });
        self.pending = Some(Pending { done, started });
        Ok(renewed)
    }

    /// Checks, without waiting, whether the last picture is done and whether it is complete.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn poll(&mut self, gpu: &Gpu) -> Result<Progress, RenderError> {
        gpu.poll()?;
        let Some(pending) = &self.pending else { return Ok(Progress::Complete) };
        let fail = |e: &dyn std::fmt::Display| RenderError::Device(format!("the counters could not be read: {e}"));
        let finished = match pending.done.try_recv() {
            Err(TryRecvError::Empty) => return Ok(Progress::Busy),
            Err(e @ TryRecvError::Disconnected) => return Err(fail(&e)),
            Ok(result) => result.map_err(|e| fail(&e))?,
        };
        let elapsed_ms = (finished - pending.started).as_secs_f64() * 1e3;
        self.pending = None;
        let mut bytes = [0u8; READ_BACK_BYTES as usize];
        bytes.copy_from_slice(&self.read_back.get_mapped_range(..).map_err(|e| fail(&e))?);
        self.read_back.unmap();
        let (counters, ticks) = bytes.split_at(COUNTER_BYTES as usize);
        let counters: Counters = bytemuck::pod_read_unaligned(counters);
        // Without timestamps there is only the sum.
        let whole = [0.0, 0.0, 0.0, 0.0, elapsed_ms, 0.0];
        let measured = self.clock.as_ref().and_then(|clock| clock.milliseconds(ticks).try_into().ok());
        let times: StageTimes = measured.unwrap_or(whole);
        self.last_ms = times.iter().sum();
        self.frame_ms.add(self.last_ms);
        self.times.add(times);
        self.intersections = counters.intersections_wanted;
        self.broken = counters.broken;
        match self.drawing.complete_for(gpu, &counters) {
            Ok(true) => Ok(Progress::Complete),
            Ok(false) => Ok(Progress::Incomplete),
            Err(RenderError::Invalid(_) | RenderError::OutOfMemory { .. }) => Ok(Progress::TooFine),
            Err(e) => Err(e),
        }
    }
}

fn target(gpu: &Gpu, width: u32, height: u32) -> Target {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    Target { view: texture.create_view(&wgpu::TextureViewDescriptor::default()), texture }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::sync::Arc;

    use ghand_avatar::Scene;
    use ghand_core::{Pose, Side};
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_render::mesh::{MeshRenderer, MeshStyle};
    use ghand_render::splat::Purpose;
    use ghand_render::{AdapterChoice, buffers};

    use super::*;
    use crate::bare_hand::{BareHand, studio_light};
    use crate::viewer::hand::tests::untrained_avatar;
    use crate::viewer::rendering::drawn_subject::DrawnSubject;
    use ghand_avatar::framing::turntable;

    /// The texture's pixels as red, green, blue and alpha.
    pub(crate) fn pixels(gpu: &Gpu, texture: &wgpu::Texture) -> Vec<u8> {
        let row = (4 * texture.width()).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let words = (row / 4 * texture.height()) as usize;
        let rows = buffers::zeroed(gpu, "rows", words);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &rows,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            texture.size(),
        );
        gpu.queue.submit([encoder.finish()]);
        let bytes: Vec<u8> = buffers::read(gpu, &rows, 4 * words).unwrap();
        bytes.chunks(row as usize).flat_map(|r| r[..4 * texture.width() as usize].to_vec()).collect()
    }

    fn picture_of(gpu: &Gpu, subject: &DrawnSubject) -> Picture {
        Picture::new(gpu, subject.on_device(gpu, [128, 128]).unwrap()).unwrap()
    }

    #[test]
    fn the_texture_holds_what_the_splatter_rendered() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let avatar = untrained_avatar();
        let pose = Pose::rest(avatar.model.joint_count());
        let mut picture = picture_of(&gpu, &DrawnSubject::Avatar(Arc::new(avatar.clone())));
        let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 1, [128, 128]).unwrap();
        scene.set_pose(&gpu, 0, 0, &pose).unwrap();
        // The second picture is smaller: rows must not be mixed up.
        for size in [[101, 77], [50, 90]] {
            let camera = &turntable(&avatar.model, &[&pose], 1, size)[0][0];
            let shot = PictureInputs {
                pose: Some(pose.clone()),
                shape: vec![],
                light: None,
                camera: camera.clone(),
                background: [0.1, 0.2, 0.3],
            };
            assert!(picture.render(&gpu, &shot).unwrap());
            gpu.wait().unwrap();
            assert_eq!(picture.poll(&gpu).unwrap(), Progress::Complete);
            let shown = pixels(&gpu, picture.texture().unwrap());
            let image = scene.render(&gpu, 0, camera, shot.background).unwrap();
            let expected = image.rgba.iter().flat_map(|p| [p[0], p[1], p[2], 1.0]);
            let worst = shown.iter().zip(expected).map(|(a, b)| (f32::from(*a) - 255.0 * b).abs()).fold(0.0, f32::max);
            // Half a step of rounding, and the error of the device's conversion.
            assert!(worst <= 0.51, "{size:?}: {worst}");
            assert!(shown.len() == image.rgba.len() * 4);
        }
    }

    #[test]
    fn a_hand_without_an_avatar_is_its_lit_mesh_over_the_background() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let model = builtin_hand(Side::Right).unwrap();
        let hand = BareHand::new(model.clone());
        let mut picture = picture_of(&gpu, &DrawnSubject::Bare(Arc::new(hand.clone())));
        let pose = Pose::rest(model.joint_count());
        let mut shape = vec![0.0; 10];
        for (size, first) in [([101, 77], 0.0), ([50, 90], 3.0)] {
            shape[0] = first;
            let camera = &turntable(&model, &[&pose], 1, size)[0][0];
            let background = [0.1, 0.2, 0.3];
            let shot = PictureInputs {
                pose: Some(pose.clone()),
                shape: shape.clone(),
                light: None,
                camera: camera.clone(),
                background,
            };
            assert!(picture.render(&gpu, &shot).unwrap());
            gpu.wait().unwrap();
            assert_eq!(picture.poll(&gpu).unwrap(), Progress::Complete);
            let shown = pixels(&gpu, picture.texture().unwrap());
            let posed = hand.posed(&shape, &pose).unwrap();
            let style = MeshStyle { supersample: 2, shading: studio_light(camera), wireframe: None };
            let image = MeshRenderer::new(&gpu).unwrap().render(&hand.instance(&posed), camera, &style).unwrap();
            let over = |p: &[f32; 4]| [0, 1, 2].map(|c| p[c] + (1.0 - p[3]) * background[c]);
            let expected = image.rgba.iter().flat_map(|p| over(p).into_iter().chain([1.0]));
            let worst = shown.iter().zip(expected).map(|(a, b)| (f32::from(*a) - 255.0 * b).abs()).fold(0.0, f32::max);
            assert!(worst <= 0.51, "{size:?}: {worst}");
            assert!(image.rgba.iter().filter(|p| p[3] > 0.5).count() > 500, "the hand is not in the picture");
        }
    }
}
