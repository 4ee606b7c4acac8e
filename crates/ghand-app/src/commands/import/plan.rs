//! The cameras around the hand, seen from above.

use ghand_capture::Capture;
use ghand_core::Camera;
use ghand_core::posing::pose_hand;
use glam::{DVec2, DVec3};
use maud::{Markup, html};

use super::round_step::round_step;

/// Size of the drawing, and its margin for names, pixels.
const SIZE: DVec2 = DVec2::new(600.0, 400.0);
const MARGIN: DVec2 = DVec2::new(140.0, 40.0);
/// At least so much is shown, metres.
const LEAST_EXTENT: f64 = 0.4;
/// Length of a camera's sign, and least distance of the rings, pixels.
const SIGN: f64 = 24.0;
const RINGS: f64 = 60.0;
/// Width of a ring's text, and distance of a camera's name, pixels.
const RING_TEXT: f64 = 50.0;
const BESIDE: f64 = 9.0;
/// Names of cameras that are further aside of the hand begin or end there.
const ASIDE: f64 = 0.15;
/// Most places of the wrist that are drawn, and cameras that have their names beside them.
const PLACES: usize = 300;
const NAMED: usize = 16;
/// Most letters of a name.
const LETTERS: usize = 12;

/// Where the wrist is in each frame, metres, world.
pub fn wrists(capture: &Capture) -> Vec<DVec3> {
    let rest = capture.template.joints.first().copied().unwrap_or_default();
    capture.frames.iter().map(|frame| rest + frame.pose.translation).collect()
}

/// The mean of points; 0 for none.
pub fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

/// The plane on which cameras stand: none tells where the floor is, so that it is the one that is level in their images.
struct Ground {
    origin: DVec3,
    right: DVec3,
    away: DVec3,
}

impl Ground {
    fn of(cameras: &[Camera], origin: DVec3) -> Option<Ground> {
        let first = cameras.first()?;
        let above = -cameras.iter().map(|camera| camera.rotation.row(1)).sum::<DVec3>();
        // Cameras that are turned in all directions have no common one.
        let agree = above.length() > 0.5 * cameras.len() as f64;
        let above = if agree { above.normalize() } else { -first.rotation.row(1) };
        let across = first.rotation.row(0);
        let right = (across - above * across.dot(above)).try_normalize().unwrap_or(above.any_orthonormal_vector());
        Some(Ground { origin, right, away: above.cross(right) })
    }

    /// Metres to the right and down.
    fn direction(&self, vector: DVec3) -> DVec2 {
        DVec2::new(vector.dot(self.right), -vector.dot(self.away))
    }

    fn place(&self, point: DVec3) -> DVec2 {
        self.direction(point - self.origin)
    }
}

/// The drawing, with the hand as in a frame; nothing without a camera.
pub fn plan(capture: &Capture, frame: usize) -> Markup {
    let wrists = wrists(capture);
    let origin = mean(&wrists);
    let Some(ground) = Ground::of(&capture.cameras, origin) else { return html! {} };
    let places: Vec<DVec2> = wrists.iter().map(|at| ground.place(*at)).collect();
    let cameras: Vec<DVec2> = capture.cameras.iter().map(|camera| ground.place(camera.center())).collect();
    let all = || places.iter().chain(&cameras).copied().filter(|at| at.is_finite());
    let half = DVec2::splat(0.5 * LEAST_EXTENT);
    let (low, high) = all().fold((-half, half), |(low, high), at| (low.min(at), high.max(at)));
    let scale = ((SIZE - 2.0 * MARGIN) / (high - low)).min_element();
    let middle = 0.5 * (low + high);
    let pixel = |at: DVec2| (at - middle) * scale + 0.5 * SIZE;
    let center = pixel(DVec2::ZERO);
    let step = round_step(RINGS / scale);
    let rings = (1..).map(|k| f64::from(k) * step).take_while(|radius| radius * scale < SIZE.x);
    let every = places.len().div_ceil(PLACES).max(1);
    html! {
        figure.plan {
            svg viewBox=(format!("0 0 {} {}", SIZE.x, SIZE.y)) width=(SIZE.x) role="img" aria-label="the cameras around the hand, seen from above" {
                @for radius in rings {
                    circle.ring cx=(px(center.x)) cy=(px(center.y)) r=(px(radius * scale)) {}
                    @if center.x + radius * scale + RING_TEXT < SIZE.x {
                        text.ring x=(px(center.x + radius * scale + 3.0)) y=(px(center.y - 3.0)) { (metres(radius)) }
                    }
                }
                @for at in places.iter().step_by(every).map(|at| pixel(*at)) {
                    circle.wrist cx=(px(at.x)) cy=(px(at.y)) r="1.5" {}
                }
                @for [a, b] in bones(capture, frame).iter().map(|bone| bone.map(|at| pixel(ground.place(at)))) {
                    line.bone x1=(px(a.x)) y1=(px(a.y)) x2=(px(b.x)) y2=(px(b.y)) {}
                }
                @for (camera, at) in capture.cameras.iter().zip(&cameras) {
                    (sign(camera, &ground, pixel(*at), &pixel, capture.cameras.len() <= NAMED))
                }
            }
            figcaption {
                "From above: where cameras stand and look, by how far they are from the hand, which is as in frame "
                (capture.frames.get(frame).map_or("", |frame| &frame.id)) ". Dots are the wrist in all chosen frames."
            }
        }
    }
}

/// A camera: what it sees as far as the sign reaches, and its axis as far as the hand.
fn sign(camera: &Camera, ground: &Ground, at: DVec2, pixel: &dyn Fn(DVec2) -> DVec2, is_named: bool) -> Markup {
    let along = |x: f64| {
        let ray = DVec3::new((x - camera.principal.x) / camera.focal.x, 0.0, 1.0);
        ground.direction(camera.rotation.transpose() * ray)
    };
    let [left, right] = [0.0, f64::from(camera.width)].map(|x| at + SIGN * along(x).normalize_or_zero());
    let depth = camera.camera_from_world(ground.origin).z.max(0.0);
    let end = pixel(ground.place(camera.center() + depth * camera.rotation.row(2)));
    let distance = camera.center().distance(ground.origin);
    let id = shortened(&camera.id);
    // Away from the hand, where nothing is drawn.
    let outward = (at - pixel(DVec2::ZERO)).try_normalize().unwrap_or(DVec2::Y);
    let anchor = match outward.x {
        x if x > ASIDE => "start",
        x if x < -ASIDE => "end",
        _ => "middle",
    };
    let name = at + BESIDE * outward + DVec2::Y * (4.0 + 5.0 * outward.y);
    html! {
        g.camera {
            title { (camera.id) ", " (metres(distance)) " from the hand" }
            line.axis x1=(px(at.x)) y1=(px(at.y)) x2=(px(end.x)) y2=(px(end.y)) {}
            polygon points=(format!("{},{} {},{} {},{}", px(at.x), px(at.y), px(left.x), px(left.y), px(right.x), px(right.y))) {}
            circle cx=(px(at.x)) cy=(px(at.y)) r="3.5" {}
            @if is_named {
                text x=(px(name.x)) y=(px(name.y)) text-anchor=(anchor) { (id) ", " (metres(distance)) }
            }
        }
    }
}

/// The posed joints, each with its parent, metres, world.
fn bones(capture: &Capture, frame: usize) -> Vec<[DVec3; 2]> {
    let Some(frame) = capture.frames.get(frame) else { return vec![] };
    let Ok(posed) = pose_hand(&capture.hand_model, &frame.shape, &frame.pose) else { return vec![] };
    let parents = capture.hand_model.parents.iter().enumerate();
    parents.filter_map(|(joint, parent)| Some([*posed.joints.get((*parent)?)?, *posed.joints.get(joint)?])).collect()
}

fn metres(length: f64) -> String {
    if length < 9.95 { format!("{length:.2} m") } else { format!("{length:.0} m") }
}

fn shortened(id: &str) -> String {
    if id.chars().count() <= LETTERS {
        return id.into();
    }
    id.chars().take(LETTERS - 1).chain(['…']).collect()
}

fn px(value: f64) -> String {
    format!("{value:.1}")
}

/// The styles of [`plan`].
pub const STYLE: &str = "
.plan svg { background: #8881; } .plan text { font-size: 13px; fill: currentColor; }
.plan .ring { fill: none; stroke: #8886; } .plan text.ring { fill: #888; stroke: none; font-size: 11px; }
.plan .wrist { fill: #888; } .plan .bone { stroke: #d08a5c; stroke-width: 3; stroke-linecap: round; }
.plan .axis { stroke: #59f; stroke-dasharray: 3 4; } .plan polygon { fill: #59f6; } .plan .camera circle { fill: #37d; }
";
