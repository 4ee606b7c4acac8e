//! Draws the stage on a canvas of a page.
//!
//! The page's script owns the loop: it calls [`Player::advance`] and [`Player::draw`] once for each animation frame in
//! which something changes. Nothing waits; what a browser answers later is a promise.

use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use ghand_avatar::view_side::ViewSide;
use ghand_avatar::{Avatar, Light, Scene};
use ghand_core::{Camera, Pose};
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_motion::motions::MOTION_NAMES;
use ghand_render::splat::Purpose;
use ghand_render::texture_pass::{ImageLayer, Target, TexturePass};
use ghand_render::{AdapterChoice, Gpu, RenderError, device};
use glam::{DMat3, DVec2, DVec3};
use js_sys::{Float32Array, Promise, Uint8ClampedArray};
use serde_json::json;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::future_to_promise;
use web_sys::HtmlCanvasElement;

use crate::description;
use crate::layer::Layer;
use crate::stage::{LightChoice, Stage};

/// Frames that may be on their way to the screen: with more, a slow device would answer late.
const MOST_UNDERWAY: u32 = 2;
/// Largest edge of a picture, pixels.
const LARGEST_EDGE: u32 = 8192;
/// Buffers are for edges of multiples of this, pixels, so that not each new size of the canvas makes new ones.
const SIZE_STEP: u32 = 256;

fn js_error(error: impl std::fmt::Display) -> JsError {
    JsError::new(&error.to_string())
}

/// A canvas with its device, and the stage that it shows.
#[wasm_bindgen]
pub struct Player {
    stage: Stage,
    gpu: Gpu,
    canvas: HtmlCanvasElement,
    surface: wgpu::Surface<'static>,
    format: wgpu::TextureFormat,
    pass: TexturePass,
    drawing: Option<Drawing>,
    /// Whether poses, light or places of hands have changed since they were given to the device.
    posed: bool,
    underway: Arc<AtomicU32>,
    /// The size that the canvas is prepared for.
    configured: Option<[u32; 2]>,
    /// What pictures are drawn with; taken out while one is drawn.
    pictures: Rc<RefCell<Option<PictureScene>>>,
}

/// Hands on the device for pictures up to a size.
struct PictureScene {
    scene: Scene,
    avatars: Vec<Rc<Avatar>>,
    largest: [u32; 2],
}

/// The hands on the device, for pictures up to a size.
struct Drawing {
    scene: Scene,
    layer: ImageLayer,
    largest: [u32; 2],
}

/// Puts poses, places and light of hands on the device.
fn give_poses(scene: &mut Scene, gpu: &Gpu, hands: &[Shown]) -> Result<(), RenderError> {
    for (number, hand) in hands.iter().enumerate() {
        if let Some(light) = &hand.light {
            scene.avatars_mut().iter_mut().skip(number).take(1).for_each(|avatar| avatar.set_light(light));
        }
        scene.set_placement(number, DMat3::IDENTITY, hand.place)?;
        scene.set_pose(gpu, number, 0, &hand.pose)?;
    }
    Ok(())
}

/// What is drawn of a hand.
struct Shown {
    avatar: Rc<Avatar>,
    pose: Pose,
    place: DVec3,
    light: Option<Light>,
}

#[wasm_bindgen]
impl Player {
    /// Opens a device for a canvas, with an empty stage. Fails in one sentence where there is no WebGPU.
    pub async fn open(canvas: HtmlCanvasElement) -> Result<Player, JsError> {
        let instance = device::instance();
        let surface = instance.create_surface(wgpu::SurfaceTarget::Canvas(canvas.clone())).map_err(js_error)?;
        let gpu = Gpu::request(instance, &AdapterChoice::Best, None).await.map_err(js_error)?;
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        let format = formats.first().copied().ok_or_else(|| js_error("the canvas has no format"))?;
        let pass = TexturePass::new(&gpu, Target::color(format)).map_err(js_error)?;
        let underway = Arc::default();
        let pictures = Rc::default();
        Ok(Player {
            stage: Stage::default(),
            gpu,
            canvas,
            surface,
            format,
            pass,
            drawing: None,
            posed: false,
            underway,
            configured: None,
            pictures,
        })
    }

    /// Takes the stage of another player, whose device was lost.
    pub fn take(&mut self, before: Player) {
        self.stage = before.stage;
        self.drawing = None;
    }

    /// The adapter's name and the kernels that run on it.
    pub fn device(&self) -> String {
        format!("{} ({})", self.gpu.info.name, self.gpu.tier.name())
    }

    /// A promise of the reason, once the device is lost.
    pub fn lost(&self) -> Promise {
        let lost = self.gpu.lost();
        future_to_promise(async move { Ok(lost.await.into()) })
    }

    /// Drops the device, as a driver that is reset does: for tests of what the page does then.
    pub fn lose(&self) {
        self.gpu.device.destroy();
    }

    /// Adds the avatar of a file's bytes; `name` is for messages. Returns its number.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> Result<usize, JsError> {
        let avatar = Avatar::from_bytes(Path::new(name), bytes).map_err(js_error)?;
        let number = self.stage.add(avatar).map_err(js_error)?;
        self.drawing = None;
        Ok(number)
    }

    /// Removes all hands.
    pub fn clear(&mut self) {
        self.stage.clear();
        self.drawing = None;
    }

    /// The number of hands.
    pub fn count(&self) -> usize {
        self.stage.hands().len()
    }

    /// What a hand is, as JSON.
    pub fn describe(&self, hand: usize) -> Result<String, JsError> {
        Ok(description::of_hand(self.stage.hand(hand).map_err(js_error)?).to_string())
    }

    /// The names of poses.
    #[wasm_bindgen(js_name = poseNames)]
    pub fn pose_names() -> Vec<String> {
        POSE_NAMES.map(str::to_owned).to_vec()
    }

    /// The names of motions.
    #[wasm_bindgen(js_name = motionNames)]
    pub fn motion_names() -> Vec<String> {
        MOTION_NAMES.map(str::to_owned).to_vec()
    }

    /// Goes to the pose of that name in some seconds.
    #[wasm_bindgen(js_name = poseNamed)]
    pub fn pose_named(&mut self, hand: usize, name: &str, seconds: f64) -> Result<(), JsError> {
        let hand = self.stage.hand_mut(hand).map_err(js_error)?;
        let pose = hand.named(name).map_err(js_error)?;
        hand.go_to(pose, seconds).map_err(js_error)?;
        self.posed = false;
        Ok(())
    }

    /// Goes in some seconds to the pose of these numbers: the axis-angle vector of each joint, radians, then, if there are
    /// three more, the translation, metres.
    #[wasm_bindgen(js_name = poseOf)]
    pub fn pose_of(&mut self, hand: usize, numbers: &[f32], seconds: f64) -> Result<(), JsError> {
        let hand = self.stage.hand_mut(hand).map_err(js_error)?;
        let joints = hand.model().joint_count();
        if numbers.len() != 3 * joints && numbers.len() != 3 * (joints + 1) {
            let problem =
                format!("a pose of {} numbers; give {} or, with a translation, three more", numbers.len(), 3 * joints);
            return Err(js_error(problem));
        }
        let mut vectors = numbers.chunks_exact(3).map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into()));
        let rotations = vectors.by_ref().take(joints).collect();
        let pose = Pose { rotations, translation: vectors.next().unwrap_or(hand.pose().translation) };
        hand.go_to(pose, seconds).map_err(js_error)?;
        self.posed = false;
        Ok(())
    }

    /// The pose now: as for [`Player::pose_of`], with the translation.
    pub fn pose(&self, hand: usize) -> Result<Float32Array, JsError> {
        let pose = self.stage.hand(hand).map_err(js_error)?.pose();
        let vectors = pose.rotations.iter().chain([&pose.translation]);
        let numbers: Vec<f32> = vectors.flat_map(|v| v.as_vec3().to_array()).collect();
        Ok(Float32Array::from(&numbers[..]))
    }

    /// Flexion, abduction and twist of a joint, radians; nothing if its name is unknown.
    pub fn angles(&self, hand: usize, joint: usize) -> Result<Option<Vec<f64>>, JsError> {
        let angles = self.stage.hand(hand).map_err(js_error)?.angles(joint);
        Ok(angles.map(|angles| angles.to_array().to_vec()))
    }

    /// Sets flexion, abduction and twist of a joint, radians.
    #[wasm_bindgen(js_name = setAngles)]
    pub fn set_angles(
        &mut self,
        hand: usize,
        joint: usize,
        flexion: f64,
        abduction: f64,
        twist: f64,
    ) -> Result<(), JsError> {
        let hand = self.stage.hand_mut(hand).map_err(js_error)?;
        hand.set_angles(joint, DVec3::new(flexion, abduction, twist)).map_err(js_error)?;
        self.posed = false;
        Ok(())
    }

    /// Plays the motion of that name.
    #[wasm_bindgen(js_name = playNamed)]
    pub fn play_named(&mut self, hand: usize, name: &str, repeat: bool) -> Result<(), JsError> {
        let hand = self.stage.hand_mut(hand).map_err(js_error)?;
        let motion = hand.motion(name).map_err(js_error)?;
        hand.play(motion, repeat);
        self.posed = false;
        Ok(())
    }

    /// Plays a file of poses, of any kind that ghand reads; a single pose is taken. Returns remarks.
    #[wasm_bindgen(js_name = playFile)]
    pub fn play_file(&mut self, hand: usize, name: &str, bytes: &[u8], repeat: bool) -> Result<Vec<String>, JsError> {
        let hand = self.stage.hand_mut(hand).map_err(js_error)?;
        let sequence = hand.read_poses(name, bytes).map_err(js_error)?;
        let warnings = sequence.warnings.clone();
        hand.play(sequence, repeat);
        self.posed = false;
        Ok(warnings)
    }

    /// The motion that is played: `{time, duration, playing, repeat, speed}` as JSON; nothing if there is none.
    pub fn playback(&self, hand: usize) -> Result<Option<String>, JsError> {
        let playback = self.stage.hand(hand).map_err(js_error)?.playback();
        Ok(playback.map(|p| {
            let duration = p.sequence.duration();
            json!({"time": p.time, "duration": duration, "playing": p.playing, "repeat": p.repeat, "speed": p.speed})
                .to_string()
        }))
    }

    /// Lets time pass in a motion, or not; from its end it begins again.
    #[wasm_bindgen(js_name = setPlaying)]
    pub fn set_playing(&mut self, hand: usize, playing: bool) -> Result<(), JsError> {
        let hand = self.stage.hand_mut(hand).map_err(js_error)?;
        let Some(playback) = hand.playback_mut() else { return Ok(()) };
        playback.playing = playing;
        let at_end = playback.time >= playback.sequence.duration();
        if playing && at_end {
            hand.seek(0.0);
        }
        Ok(())
    }

    /// Sets the speed of a motion: 1 is its own; less than 0 plays backwards.
    #[wasm_bindgen(js_name = setSpeed)]
    pub fn set_speed(&mut self, hand: usize, speed: f64) -> Result<(), JsError> {
        if !speed.is_finite() {
            return Err(js_error("the speed is not finite"));
        }
        let hand = self.stage.hand_mut(hand).map_err(js_error)?;
        hand.playback_mut().into_iter().for_each(|playback| playback.speed = speed);
        Ok(())
    }

    /// Goes to a time of the motion, seconds.
    pub fn seek(&mut self, hand: usize, seconds: f64) -> Result<(), JsError> {
        self.stage.hand_mut(hand).map_err(js_error)?.seek(seconds);
        self.posed = false;
        Ok(())
    }

    /// Gives a packet of live poses, JSON, to the hands; `seconds` is when it came.
    pub fn packet(&mut self, packet: &[u8], seconds: f64, in_place: bool) -> Result<(), JsError> {
        self.stage.take_packet(packet, seconds, in_place).map_err(js_error)?;
        self.posed = false;
        Ok(())
    }

    /// Puts the hands into the light `capture` or `studio`, turned about the vertical by an angle, degrees.
    #[wasm_bindgen(js_name = setLight)]
    pub fn set_light(&mut self, name: &str, turn: f64) -> Result<(), JsError> {
        let light = match name {
            "capture" => LightChoice::Capture,
            "studio" => LightChoice::Studio,
            other => return Err(js_error(format!("there is no light {other:?}; there are capture, studio"))),
        };
        self.stage.set_light(light, turn.to_radians()).map_err(js_error)?;
        self.posed = false;
        Ok(())
    }

    /// Shows the layer `skin`, `albedo` or `views` of all hands.
    #[wasm_bindgen(js_name = setLayer)]
    pub fn set_layer(&mut self, name: &str) -> Result<(), JsError> {
        let unknown =
            || js_error(format!("there is no layer {name:?}; there are {}", Layer::ALL.map(Layer::name).join(", ")));
        self.stage.show(Layer::of(name).ok_or_else(unknown)?).map_err(js_error)?;
        self.drawing = None;
        Ok(())
    }

    /// The layer that is shown.
    pub fn layer(&self) -> String {
        self.stage.layer().name().into()
    }

    /// Rotates the view by a drag, CSS pixels.
    pub fn orbit(&mut self, x: f64, y: f64) {
        self.stage.orbit_mut().into_iter().for_each(|orbit| orbit.orbit(DVec2::new(x, y)));
    }

    /// Moves the view by a drag, CSS pixels; `edge` is the picture's shorter edge.
    pub fn pan(&mut self, x: f64, y: f64, edge: f64) {
        self.stage.orbit_mut().into_iter().for_each(|orbit| orbit.pan(DVec2::new(x, y), edge));
    }

    /// Moves `factor` times nearer to what is at a point, CSS pixels from the picture's middle.
    #[wasm_bindgen(js_name = zoomAt)]
    pub fn zoom_at(&mut self, factor: f64, x: f64, y: f64, edge: f64) {
        if factor > 0.0 && factor.is_finite() {
            self.stage.orbit_mut().into_iter().for_each(|orbit| orbit.zoom_at(factor, DVec2::new(x, y), edge));
        }
    }

    /// Faces the hands, as at the beginning.
    pub fn face(&mut self) {
        self.stage.face();
    }

    /// Moves the view, without turning it, so that the hands fill the picture.
    pub fn frame(&mut self) {
        self.stage.frame();
    }

    /// Turns the view to a side: `back`, `palm`, `thumb-side`, `little-finger-side` or `fingertips`.
    #[wasm_bindgen(js_name = lookFrom)]
    pub fn look_from(&mut self, side: &str) -> Result<(), JsError> {
        let all = ViewSide::ALL.map(ViewSide::name).join(", ");
        let side = ViewSide::of(side).ok_or_else(|| js_error(format!("there is no side {side:?}; there are {all}")))?;
        self.stage.look_from(side);
        Ok(())
    }

    /// Looks along z with y down, as the camera of a tracker does, and frames the hands.
    #[wasm_bindgen(js_name = lookAsTracker)]
    pub fn look_as_tracker(&mut self) {
        self.stage.orbit_mut().into_iter().for_each(|orbit| orbit.look_along_world());
        self.stage.frame();
    }

    /// Looks from a position to a target: nine numbers, position, target and up, metres, world, and the field of view along
    /// the shorter edge, degrees.
    #[wasm_bindgen(js_name = lookAt)]
    pub fn look_at(&mut self, numbers: &[f64], field_of_view: f64) -> Result<(), JsError> {
        if numbers.len() != 9 {
            return Err(js_error("a camera has a position, a target and an up, of three numbers each"));
        }
        let [position, target, up] = [0, 3, 6].map(|k| DVec3::from_slice(&numbers[k..]));
        self.stage.look_at(position, target, up, field_of_view.to_radians()).map_err(js_error)
    }

    /// The view, as JSON: `{position, target, up, fov}`; nothing without a hand.
    pub fn view(&self) -> Option<String> {
        let camera = self.stage.camera([1, 1])?;
        let point = self.stage.view_point()?;
        let up = -camera.rotation.row(1);
        let [position, target, up] = [camera.center(), point.target, up].map(|v| v.to_array());
        let fov = point.field_of_view.to_degrees();
        Some(json!({"position": position, "target": target, "up": up, "fov": fov}).to_string())
    }

    /// Lets `seconds` pass. Says whether something moves now.
    pub fn advance(&mut self, seconds: f64) -> bool {
        if self.stage.advance(seconds) {
            self.posed = false;
        }
        self.stage.is_moving()
    }

    /// Whether the device has not drawn the last pictures yet, so that another one would only be late.
    pub fn busy(&self) -> bool {
        self.underway.load(Ordering::Relaxed) >= MOST_UNDERWAY
    }

    /// Whether the device has drawn all pictures.
    pub fn idle(&self) -> bool {
        self.underway.load(Ordering::Relaxed) == 0
    }

    /// Draws the stage in the canvas's own size. Says whether the picture must be drawn again, because it lacks Gaussians.
    pub fn draw(&mut self) -> Result<bool, JsError> {
        self.gpu.check().map_err(js_error)?;
        let size = [self.canvas.width().clamp(1, LARGEST_EDGE), self.canvas.height().clamp(1, LARGEST_EDGE)];
        if self.configured != Some(size) {
            self.configure(size);
        }
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let mut grown = false;
        if let Some(camera) = self.stage.camera(size) {
            grown = self.encode_hands(&camera, &mut encoder).map_err(js_error)?;
        }
        let texture = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(texture) | wgpu::CurrentSurfaceTexture::Suboptimal(texture) => texture,
            _ => return Ok(true),
        };
        let view = texture.texture.create_view(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("canvas"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        if let Some(Drawing { layer, .. }) = self.drawing.as_ref().filter(|_| self.count() > 0) {
            self.pass.set_place(&self.gpu, layer, [0; 2], size, [0.0; 3]);
            self.pass.draw(&mut pass, layer);
        }
        drop(pass);
        self.gpu.queue.submit([encoder.finish()]);
        self.underway.fetch_add(1, Ordering::Relaxed);
        let underway = self.underway.clone();
        self.gpu.queue.on_submitted_work_done(move || {
            underway.fetch_sub(1, Ordering::Relaxed);
        });
        Ok(grown)
    }

    /// A picture of the stage in any size over a background (display values, 0 to 1): a promise of its RGBA bytes.
    pub fn picture(&self, width: u32, height: u32, red: f32, green: f32, blue: f32) -> Promise {
        let camera = match self.stage.camera([width, height]) {
            _ if !(1..=LARGEST_EDGE).contains(&width) || !(1..=LARGEST_EDGE).contains(&height) => {
                Err(format!("a picture of {width} x {height} pixels; each edge must be from 1 to {LARGEST_EDGE}"))
            }
            Some(camera) => Ok(camera),
            None => Err("there is no hand to draw".to_owned()),
        };
        let shown = self.shown();
        let gpu = self.gpu.clone();
        let pictures = self.pictures.clone();
        future_to_promise(async move {
            let camera = camera.map_err(js_error)?;
            let kept = pictures.borrow_mut().take();
            let (kept, bytes) = picture(&gpu, kept, &shown, &camera, [red, green, blue]).await.map_err(js_error)?;
            pictures.borrow_mut().replace(kept);
            Ok(Uint8ClampedArray::from(&bytes[..]).into())
        })
    }
}

impl Player {
    /// The hands as they are drawn now.
    fn shown(&self) -> Vec<Shown> {
        let shown = |hand: &crate::hand::Hand| Shown {
            avatar: hand.shown().clone(),
            pose: hand.pose().clone(),
            place: hand.place,
            light: self.stage.light_on(hand),
        };
        self.stage.hands().iter().map(shown).collect()
    }

    /// Prepares the canvas for pictures of a size.
    fn configure(&mut self, size: [u32; 2]) {
        self.surface.configure(
            &self.gpu.device,
            &wgpu::SurfaceConfiguration {
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                format: self.format,
                width: size[0],
                height: size[1],
                present_mode: wgpu::PresentMode::Fifo,
                desired_maximum_frame_latency: 2,
                alpha_mode: wgpu::CompositeAlphaMode::PreMultiplied,
                view_formats: vec![],
                color_space: Default::default(),
            },
        );
        self.configured = Some(size);
    }

    /// Encodes posing and drawing; says whether buffers have grown, so that the picture must be drawn again.
    fn encode_hands(&mut self, camera: &Camera, encoder: &mut wgpu::CommandEncoder) -> Result<bool, RenderError> {
        let size = [camera.width, camera.height];
        let fits = |drawing: &Drawing| drawing.largest[0] >= size[0] && drawing.largest[1] >= size[1];
        let has_room = self.drawing.as_ref().is_some_and(fits);
        let shown = if has_room && self.posed { vec![] } else { self.shown() };
        if !has_room {
            let largest = size.map(|edge| edge.next_multiple_of(SIZE_STEP));
            let scene = scene_of(&self.gpu, &shown, largest)?;
            let layer = self.pass.layer(&self.gpu, scene.splatter())?;
            self.drawing = Some(Drawing { scene, layer, largest });
            self.posed = false;
        }
        let Some(Drawing { scene, .. }) = &mut self.drawing else { return Ok(false) };
        if !self.posed {
            give_poses(scene, &self.gpu, &shown)?;
            self.posed = true;
        }
        scene.set_frame(&self.gpu, 0);
        scene.set_view(&self.gpu, camera, [0.0; 3])?;
        scene.encode_growing(&self.gpu, encoder)
    }
}

/// The hands on the device, for pictures up to a size.
fn scene_of(gpu: &Gpu, shown: &[Shown], largest: [u32; 2]) -> Result<Scene, RenderError> {
    let avatars: Vec<&Avatar> = shown.iter().map(|hand| &*hand.avatar).collect();
    Scene::new(gpu, &avatars, Purpose::Images, 1, largest)
}

/// A picture's RGBA bytes, opaque, and the scene that drew it: the one before, if it fits.
async fn picture(
    gpu: &Gpu,
    before: Option<PictureScene>,
    shown: &[Shown],
    camera: &Camera,
    background: [f32; 3],
) -> Result<(PictureScene, Vec<u8>), RenderError> {
    let size = [camera.width, camera.height];
    let fits = |kept: &PictureScene| {
        let same = kept.avatars.len() == shown.len()
            && kept.avatars.iter().zip(shown).all(|(avatar, hand)| Rc::ptr_eq(avatar, &hand.avatar));
        same && kept.largest[0] >= size[0] && kept.largest[1] >= size[1]
    };
    let mut kept = match before.filter(fits) {
        Some(kept) => kept,
        None => PictureScene {
            scene: scene_of(gpu, shown, size)?,
            avatars: shown.iter().map(|hand| hand.avatar.clone()).collect(),
            largest: size,
        },
    };
    give_poses(&mut kept.scene, gpu, shown)?;
    let image = kept.scene.render_async(gpu, 0, camera, background).await?;
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    let bytes = image.rgba.iter().flat_map(|[r, g, b, _]| [byte(*r), byte(*g), byte(*b), 255]).collect();
    Ok((kept, bytes))
}

/// Prints panics, which stop the player, to the page's console.
#[wasm_bindgen(start)]
pub fn start() {
    std::panic::set_hook(Box::new(|info| wasm_bindgen::throw_str(&format!("ghand has stopped: {info}"))));
}
