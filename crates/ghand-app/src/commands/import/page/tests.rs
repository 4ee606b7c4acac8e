use std::collections::BTreeMap;

use ghand_capture::capture::{Frame, HandModelSource, ImagePaths};
use ghand_capture::images::color_correction::ColorCorrection;
use ghand_core::{Camera, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use glam::DVec3;
use image::Rgb;

use super::*;
use crate::commands::import::timeline::Seen;

const NAME: &str = "<img src=x onerror=alert(1)>\"'.mp4";

/// An element of a page, with the text behind its tag.
#[derive(Debug)]
struct Element {
    name: String,
    attributes: String,
    text: String,
}

impl Element {
    fn attribute(&self, name: &str) -> Option<&str> {
        let start = self.attributes.find(&format!(" {name}=\""))? + name.len() + 3;
        self.attributes[start..].split('"').next()
    }

    fn number(&self, name: &str) -> f64 {
        self.attribute(name).unwrap().parse().unwrap()
    }
}

/// The elements of a page, which must be closed in order.
fn elements(page: &str) -> Vec<Element> {
    const VOID: [&str; 4] = ["meta", "img", "input", "br"];
    let mut open: Vec<String> = vec![];
    let mut all: Vec<Element> = vec![];
    for part in page.split('<').skip(1).filter(|part| !part.starts_with('!')) {
        let (tag, text) = part.split_once('>').unwrap_or_else(|| panic!("a tag without end: {part}"));
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name));
            continue;
        }
        let end = tag.find([' ', '/']).unwrap_or(tag.len());
        let (name, attributes) = tag.split_at(end);
        all.push(Element { name: name.into(), attributes: attributes.into(), text: text.into() });
        if !VOID.contains(&name) {
            open.push(name.into());
        }
    }
    assert!(open.is_empty(), "{open:?} are not closed");
    all
}

/// A hand before three cameras, the second at its left, the third behind it.
fn capture() -> Capture {
    let model = builtin_hand(Side::Right).unwrap();
    let camera = |id: &str, eye: [f64; 3]| {
        let middle = model.joints[0];
        Camera { id: id.into(), ..Camera::look_at(middle + DVec3::from(eye), middle, DVec3::NEG_Y, 0.8, 640, 480) }
    };
    let frame = |id: &str| Frame {
        id: id.into(),
        pose: Pose::rest(model.joint_count()),
        shape: vec![0.0; model.shape_count()],
    };
    Capture {
        root: format!("/somewhere/{NAME}").into(),
        side: Side::Right,
        background: [0.0; 3],
        hand_model_source: HandModelSource::Builtin,
        template: model.clone(),
        cameras: vec![
            camera(NAME, [0.0, 0.0, -0.5]),
            camera("side", [-0.8, 0.0, 0.0]),
            camera("behind", [0.0, 0.0, 1.0]),
        ],
        distortion: vec![],
        color_correction: ColorCorrection::default(),
        frames: vec![frame("00007"), frame(NAME)],
        images: ImagePaths::plain("{camera}/{frame}.jpg", None),
        splits: BTreeMap::new(),
        truth: None,
        hand_model: model,
    }
}

fn line(title: &str) -> Timeline {
    let seen = |k: usize| match k {
        0..=9 => Seen::Nothing,
        10..=29 => Seen::Blurred,
        _ => Seen::Sharp,
    };
    Timeline {
        title: title.into(),
        images: (0..90).map(|k| (k as f64 / 30.0, seen(k))).collect(),
        residuals: (0..90).map(|k| (k as f64 / 30.0, (k > 30 && k != 60).then_some(4.0))).collect(),
        chosen: vec![1.5, 2.0],
    }
}

fn found(capture: &Capture, timelines: Vec<Timeline>) -> Found {
    Found {
        decisions: vec![Decision::new(NAME, NAME, "grounds", "--cameras, --board")],
        cameras: capture.cameras.iter().map(|camera| CameraSummary::of(capture, camera)).collect(),
        sentences: vec![NAME.into()],
        timelines,
        notes: vec![format!("{NAME}: </li><script>alert(1)</script>")],
    }
}

fn page(capture: &Capture, found: &Found, sheet: Result<RgbImage, String>) -> Vec<Element> {
    let pictures = Pictures { sheet, strip: turntable::strip(capture, 1).map_err(|e| e.to_string()), frame: 1 };
    let text = markup(capture, &format!("ghand import {NAME}"), found, &pictures).unwrap().into_string();
    assert!(text.len() < 3_000_000);
    elements(&text)
}

fn count(page: &[Element], name: &str, attributes: &str) -> usize {
    page.iter().filter(|e| e.name == name && e.attributes.contains(attributes)).count()
}

#[test]
fn names_of_files_are_text_and_nothing_else() {
    let capture = capture();
    let page = page(&capture, &found(&capture, vec![line(NAME)]), Err(NAME.into()));
    assert_eq!(count(&page, "script", ""), 0);
    let pictures: Vec<&Element> = page.iter().filter(|e| e.name == "img").collect();
    // The turntable.
    assert!(pictures.len() == 1 && pictures[0].attribute("src").unwrap().starts_with("data:image/png;base64,"));
    let is_outside =
        |e: &&Element| e.attribute("src").or(e.attribute("href")).is_some_and(|at| !at.starts_with("data:"));
    assert!(!page.iter().any(|e| is_outside(&e)) && !pictures[0].attributes.contains("onerror"));
    let named = page.iter().filter(|e| e.text.contains("&lt;img src=x")).count();
    assert!(named >= 8, "{named}");
}

#[test]
fn a_page_has_table_plan_turntable_time_lines_and_sheet() {
    let capture = capture();
    let sheet = RgbImage::from_pixel(40, 30, Rgb([1, 2, 3]));
    let page = page(&capture, &found(&capture, vec![line("a"), line("b")]), Ok(sheet.clone()));
    assert_eq!(count(&page, "table", "decisions"), 1);
    let options: Vec<&str> = page.iter().filter(|e| e.name == "code").map(|e| e.text.as_str()).collect();
    assert_eq!(options, ["--cameras", "--board"]);
    // A button for each side, and one to turn; one of them is chosen.
    assert_eq!(count(&page, "input", "type=\"radio\""), turntable::VIEWS + 1);
    assert_eq!(count(&page, "input", " checked"), 1);
    assert_eq!(count(&page, "img", "data:image/png"), 2);
    assert_eq!(count(&page, "figure", "timeline"), 2);
    // Each line: three runs, two chosen moments, a curve with a gap.
    for kind in ["nothing", "blurred", "sharp"] {
        assert_eq!(count(&page, "rect", &format!("class=\"{kind}\"")), 2);
    }
    assert_eq!(count(&page, "rect", "class=\"chosen\""), 4);
    let curve = page.iter().find(|e| e.name == "path").unwrap().attribute("d").unwrap();
    assert_eq!(curve.matches('M').count(), 2, "{curve}");
    let ends = |e: &&Element| e.number("x") + e.number("width") <= 951.0 && e.number("x") >= 0.0;
    assert!(page.iter().filter(|e| e.name == "rect").all(|e| ends(&e)));
    assert_eq!(page.iter().filter(|e| e.name == "text" && e.text.ends_with(" s")).count(), 14, "0 to 3 s in both");
    // A data set has no time lines.
    let without = self::page(&capture, &found(&capture, vec![]), Ok(sheet));
    assert_eq!((count(&without, "figure", "timeline"), count(&without, "img", "data:image/png")), (0, 2));
}

#[test]
fn cameras_stand_in_the_plan_as_around_the_hand() {
    let capture = capture();
    let page = page(&capture, &found(&capture, vec![]), Err("no device".into()));
    let ring = page.iter().find(|e| e.name == "circle" && e.attributes.contains("ring")).unwrap();
    let [x, y] = [ring.number("cx"), ring.number("cy")];
    let signs: Vec<&Element> = page.iter().filter(|e| e.name == "circle" && e.attribute("r") == Some("3.5")).collect();
    let places: Vec<[f64; 2]> = signs.iter().map(|e| [e.number("cx") - x, e.number("cy") - y]).collect();
    let [first, side, behind] = places[..] else { panic!("{places:?}") };
    assert!(first[0].abs() < 0.2 && first[1] > 10.0, "the first camera is below: {first:?}");
    // It looks along z with y down, so that its left is -x.
    assert!(side[1].abs() < 0.2 && side[0] < -10.0, "{side:?}");
    assert!((side[0] / first[1] + 1.6).abs() < 0.02 && (behind[1] / first[1] + 2.0).abs() < 0.02, "{places:?}");
    // Axes end at the hand, which is where all look.
    for axis in page.iter().filter(|e| e.name == "line" && e.attributes.contains("axis")) {
        assert!((axis.number("x2") - x).abs() < 0.2 && (axis.number("y2") - y).abs() < 0.2, "{axis:?}");
    }
    assert_eq!(count(&page, "line", "bone"), capture.hand_model.joint_count() - 1);
    let labels: Vec<&str> =
        page.iter().filter(|e| e.name == "text" && e.attributes.contains("anchor")).map(|e| e.text.as_str()).collect();
    assert!(labels.contains(&"side, 0.80 m") && labels.contains(&"behind, 1.00 m"), "{labels:?}");
    let inside = |e: &&Element| (0.0..600.0).contains(&e.number("cx")) && (0.0..400.0).contains(&e.number("cy"));
    assert!(signs.iter().all(inside));
}

#[test]
fn the_strip_shows_the_hand_from_different_sides() {
    let strip = turntable::strip(&capture(), 0).unwrap();
    let width = strip.width() / turntable::VIEWS as u32;
    let paper = *strip.get_pixel(0, 0);
    let hand = |view: u32| -> Vec<bool> {
        let at = |k: u32| strip.get_pixel(view * width + k % width, k / width);
        (0..width * strip.height()).map(|k| *at(k) != paper).collect()
    };
    let covered = |view| hand(view).iter().filter(|inside| **inside).count();
    let all = (width * strip.height()) as usize;
    for view in 0..turntable::VIEWS as u32 {
        assert!((all / 20..all * 3 / 4).contains(&covered(view)), "view {view}: {} of {all}", covered(view));
        let next = hand((view + 1) % turntable::VIEWS as u32);
        assert_ne!(hand(view), next);
    }
    // A hand is wider from its back than from its side.
    assert!(covered(0) as f64 > 1.2 * covered(turntable::VIEWS as u32 / 4) as f64);
}
