//! Measures the speed of image decoding and the memory of annotations. Run by hand, see
//! `docs/benchmarks.md`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Instant;

use ghand_capture::{Capture, OpenOptions, ViewStore, ViewStoreOptions};
use ghand_core::PoseSpace;
use ghand_test_support::procedural_hand::ProceduralHand;
use ghand_test_support::shared;
use glam::DVec3;

#[test]
#[ignore = "a measurement"]
fn decoding_of_blender_a() {
    let Some(folder) = shared("captures/blender-a") else { return };
    let start = Instant::now();
    let capture = Capture::open(&folder).unwrap();
    println!("opened in {:.3} s", start.elapsed().as_secs_f64());
    let pairs: Vec<(usize, usize)> = capture.splits["train"].views.iter().map(|v| (v.camera, v.frame)).collect();
    for threads in [1, 2] {
        let options = ViewStoreOptions { threads: Some(threads), ..Default::default() };
        let store = ViewStore::new(&capture, &options).unwrap();
        for pass in ["decoded", "kept"] {
            let start = Instant::now();
            store.map(&pairs, |_| ()).unwrap();
            let rate = pairs.len() as f64 / start.elapsed().as_secs_f64();
            println!("{threads} threads: {rate:.0} images/s {pass}, {} MiB kept", store.kept_bytes() >> 20);
        }
    }
}

/// Images of the generated subset; each takes about 590 bytes with its annotation.
const IMAGES: usize = 530_000;
/// Frames of the generated subset; each takes about 2.4 kB with both hands.
const FRAMES: usize = 125_000;
/// One of this many images and frames belongs to the wanted sequences.
const WANTED: usize = 10;

#[test]
#[ignore = "a measurement"]
fn memory_of_annotations_of_300_megabytes() {
    let folder = tempfile::tempdir().unwrap();
    write_annotations(folder.path());
    let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    model.pose_space = Some(PoseSpace { mean: vec![DVec3::ZERO; 15], components: vec![] });
    let options = OpenOptions { mano: Some(model), ..Default::default() };
    println!("before: {}", peak_memory());
    let start = Instant::now();
    // All images are missing, which is detected last.
    let message = Capture::open_with(folder.path(), &options).unwrap_err().to_string();
    println!("read in {:.1} s, {}: {message}", start.elapsed().as_secs_f64(), peak_memory());
}

fn write_annotations(root: &Path) {
    std::fs::create_dir_all(root.join("images/test/Capture0")).unwrap();
    std::fs::create_dir_all(root.join("annotations/test")).unwrap();
    let file = |kind: &str| {
        let path = root.join(format!("annotations/test/InterHand2.6M_test_{kind}.json"));
        BufWriter::new(std::fs::File::create(path).unwrap())
    };
    let list = |out: &mut dyn Write, count: usize, item: &dyn Fn(usize) -> String| {
        for i in 0..count {
            let comma = if i == 0 { "" } else { ", " };
            write!(out, "{comma}{}", item(i)).unwrap();
        }
    };
    let camera = |i: usize| 400_000 + i % 100;
    let mut out = file("camera");
    let table = |entry: &str| {
        let entries: Vec<String> = (0..100).map(|i| format!("\"{}\": {entry}", camera(i))).collect();
        entries.join(", ")
    };
    write!(
        out,
        "{{\"0\": {{\"campos\": {{{}}}, \"camrot\": {{{}}}, \"focal\": {{{}}}, \"princpt\": {{{}}}}}}}",
        table("[1.5, 2.5, 900.0]"),
        table("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"),
        table("[1200.0, 1200.0]"),
        table("[167.0, 256.0]"),
    )
    .unwrap();
    let mut out = file("data");
    let sequence = |i: usize| match i % (2 * WANTED) {
        0 => "ROM04_RT_Occlusion",
        1 => "ROM03_RT_No_Occlusion",
        _ => "ROM07_Rt_Finger_Occlusions",
    };
    // Cameras change fastest, then sequences.
    let frame = |i: usize| 10_000 + i / 100;
    write!(out, "{{\"images\": [").unwrap();
    list(&mut out, IMAGES, &|i| {
        let sequence = sequence(i / 100);
        let camera = camera(i);
        let frame = frame(i);
        format!(
            "{{\"id\": {i}, \"file_name\": \"Capture0/{sequence}/cam{camera}/image{frame}.jpg\", \"width\": 334, \
             \"height\": 512, \"capture\": 0, \"subject\": 1, \"seq_name\": \"{sequence}\", \"camera\": \"{camera}\", \
             \"frame_idx\": {frame}}}"
        )
    });
    write!(out, "], \"annotations\": [").unwrap();
    let valid = vec!["1"; 42].join(", ");
    list(&mut out, IMAGES, &|i| {
        format!(
            "{{\"id\": {i}, \"image_id\": {i}, \"bbox\": [100.123456789, 101.123456789, 120.5, 130.25], \
             \"joint_valid\": [{valid}], \"hand_type\": \"right\", \"hand_type_valid\": 1}}"
        )
    });
    write!(out, "]}}").unwrap();
    out.flush().unwrap();
    let mut out = file("MANO_NeuralAnnot");
    let numbers = |count: usize, i: usize| {
        let number = |k: usize| format!("{:.16}", ((i * 31 + k * 7) % 1000) as f64 / 1234.5 - 0.3);
        (0..count).map(number).collect::<Vec<_>>().join(", ")
    };
    let hand = |i: usize| {
        format!("{{\"pose\": [{}], \"shape\": [{}], \"trans\": [{}]}}", numbers(48, i), numbers(10, 7), numbers(3, i))
    };
    write!(out, "{{\"0\": {{").unwrap();
    list(&mut out, FRAMES, &|i| format!("\"{}\": {{\"right\": {}, \"left\": {}}}", 10_000 + i, hand(i), hand(i + 1)));
    write!(out, "}}}}").unwrap();
    out.flush().unwrap();
    for kind in ["camera", "data", "MANO_NeuralAnnot"] {
        let path = root.join(format!("annotations/test/InterHand2.6M_test_{kind}.json"));
        println!("{kind}: {} MB", std::fs::metadata(path).unwrap().len() / 1_000_000);
    }
}

/// The largest amount of memory that this process has used so far.
fn peak_memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    line.map_or("not known on this system".into(), |line| line.split_whitespace().collect::<Vec<_>>().join(" "))
}
