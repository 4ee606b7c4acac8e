//! The hand from all sides, as one strip of pictures that turns, or is turned with buttons: without scripts.

use anyhow::Context;
use ghand_avatar::framing;
use ghand_capture::Capture;
use ghand_capture::inspection::posed_template;
use ghand_render::mesh::{MeshInstance, MeshStyle, Surface};
use ghand_render::reference::mesh::render;
use glam::DVec3;
use image::imageops::replace;
use image::{Rgb, RgbImage};
use maud::{Markup, html};
use rayon::prelude::*;

use crate::bare_hand::studio_light;
use crate::html_page::data_url;

/// Directions from which the hand is shown.
pub const VIEWS: usize = 12;
/// Size of a picture, pixels.
const SIZE: [u32; 2] = [260, 320];
/// Samples per pixel along each axis.
const SUPERSAMPLE: u32 = 3;
/// Colours of the hand, display values, and of what is behind it.
const CLAY: DVec3 = DVec3::new(0.88, 0.74, 0.65);
const PAPER: Rgb<u8> = Rgb([40, 40, 44]);
/// Seconds of a turn.
const TURN: usize = 9;

/// The pictures side by side, beginning with the back of the hand; drawn without a device.
///
/// # Errors
/// If the hand in this frame's shape and pose cannot be drawn.
pub fn strip(capture: &Capture, frame: usize) -> anyhow::Result<RgbImage> {
    let pose = &capture.frames.get(frame).context("the capture has no such frame")?.pose;
    let (positions, _) = posed_template(capture, frame)?;
    let model = &capture.template;
    let cameras = framing::turntable(model, &[pose], VIEWS, SIZE).into_iter().flatten().collect::<Vec<_>>();
    let mesh = MeshInstance {
        positions: &positions,
        normals: &model.vertex_normals(&positions),
        light_visibility: None,
        triangles: &model.faces,
        surface: Surface::Color(CLAY),
    };
    let drawn: Vec<_> = cameras
        .par_iter()
        .map(|camera| {
            let style = MeshStyle { supersample: SUPERSAMPLE, shading: studio_light(camera), wireframe: None };
            render(&mesh, camera, &style)
        })
        .collect::<Result<_, _>>()?;
    let mut strip = RgbImage::from_pixel(VIEWS as u32 * SIZE[0], SIZE[1], PAPER);
    for (view, image) in drawn.iter().enumerate() {
        let mut pixels = image.rgba.iter();
        let picture = RgbImage::from_fn(image.width, image.height, |_, _| {
            let [r, g, b, cover] = pixels.next().copied().unwrap_or_default();
            let over = |value: f32, k: usize| (255.0 * value + (1.0 - cover) * f32::from(PAPER.0[k])).round() as u8;
            Rgb([over(r, 0), over(g, 1), over(b, 2)])
        });
        replace(&mut strip, &picture, (view * SIZE[0] as usize) as i64, 0);
    }
    Ok(strip)
}

/// The strip behind a window of one picture, and a button for each side.
///
/// # Errors
/// If the strip cannot be encoded.
pub fn turntable(strip: &RgbImage, frame: &str) -> anyhow::Result<Markup> {
    let degrees = |view: usize| format!("from {} degrees", view * 360 / VIEWS);
    Ok(html! {
        figure.turntable {
            div.turn {
                input type="radio" name="turn" checked aria-label="turning" title="turning";
                @for view in 0..VIEWS {
                    input type="radio" name="turn" aria-label=(degrees(view)) title=(degrees(view));
                }
                div.view { img src=(data_url(strip)?) alt={ "the fitted hand from " (VIEWS) " sides" }; }
            }
            figcaption {
                "The fitted hand in the pose of frame " (frame) ". The first button turns it, the others show it from one side."
            }
        }
    })
}

/// The styles of [`turntable`].
pub fn style() -> String {
    let [width, height] = SIZE;
    let mut style = format!(
        ".turn {{ display: flex; flex-wrap: wrap; justify-content: space-between; width: {width}px; max-width: 100%; }}
.turn input {{ margin: .4rem 0 0; width: 14px; }} .turn .view {{ order: -1; width: 100%; overflow: hidden; border-radius: 6px; }}
.turn img {{ display: block; width: {}%; max-width: none; aspect-ratio: {} / {height}; border-radius: 0; animation: turn {TURN}s steps({VIEWS}) infinite; }}
@keyframes turn {{ to {{ transform: translateX(-100%); }} }}
@media (prefers-reduced-motion: reduce) {{ .turn img {{ animation: none; }} }}
",
        100 * VIEWS,
        width as usize * VIEWS,
    );
    for view in 0..VIEWS {
        style += &format!(
            ".turn input:nth-of-type({}):checked ~ .view img {{ animation: none; transform: translateX({:.4}%); }}\n",
            view + 2,
            -100.0 * view as f64 / VIEWS as f64
        );
    }
    style
}
