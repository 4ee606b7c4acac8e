//! Footage made by ffmpeg, in the forms in which cameras write it.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

use std::path::{Path, PathBuf};
use std::process::Command;

use ghand_footage::{Footage, FootageError, Frames};
use image::{Rgb, RgbImage};

/// Runs ffmpeg in a folder.
fn ffmpeg(folder: &Path, arguments: &str) {
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let status = Command::new("ffmpeg").current_dir(folder).args(["-y", "-v", "error"]).args(&arguments).status();
    assert!(status.unwrap().success(), "ffmpeg {arguments:?}");
}

/// A film of `count` frames, 64 x 48, whose frame k has the grey value 4 k + 8 and a red corner at the upper left.
fn film(folder: &Path, name: &str, count: u32, options: &str) -> PathBuf {
    let pictures = folder.join("pictures");
    std::fs::create_dir_all(&pictures).unwrap();
    for k in 0..count {
        let grey = (4 * k + 8) as u8;
        let picture =
            RgbImage::from_fn(64, 48, |x, y| if x < 16 && y < 16 { Rgb([250, 0, 0]) } else { Rgb([grey; 3]) });
        picture.save(pictures.join(format!("{k:03}.png"))).unwrap();
    }
    ffmpeg(folder, &format!("-framerate 30 -i pictures/%03d.png {options} {name}"));
    folder.join(name)
}

/// The frames that come: their numbers and pixels.
fn all(frames: &mut Frames) -> Result<Vec<(usize, Vec<u8>)>, FootageError> {
    let mut found = vec![];
    let mut rgb = vec![];
    while let Some(number) = frames.next_into(&mut rgb)? {
        found.push((number, rgb.clone()));
    }
    Ok(found)
}

/// The first frame.
fn first(footage: &Footage) -> Vec<u8> {
    let mut rgb = vec![];
    assert_eq!(footage.frames().unwrap().next_into(&mut rgb).unwrap(), Some(0));
    rgb
}

/// The numbers of the frames that come, each checked against its grey value.
fn numbers(footage: &Footage) -> Vec<usize> {
    let (width, height) = footage.size();
    let frames = all(&mut footage.frames().unwrap()).unwrap().into_iter().map(|(number, rgb)| {
        assert_eq!(rgb.len(), width as usize * height as usize * 3);
        let middle = (height / 2 * width + width / 2) as usize * 3;
        let grey = f64::from(rgb[middle]);
        assert!((grey - (4 * number + 8) as f64).abs() < 3.0, "frame {number}: {grey}");
        number
    });
    frames.collect()
}

const H264: &str = "-c:v libx264 -crf 10 -pix_fmt yuv420p -bf 2";

#[test]
fn frames_come_in_order_with_their_times() {
    let folder = tempfile::tempdir().unwrap();
    for (name, options) in [("a.mp4", H264), ("a.mkv", H264), ("a.mov", "-c:v mjpeg -q:v 2"), ("a.ts", H264)] {
        let footage = Footage::open(&film(folder.path(), name, 50, options)).unwrap();
        assert_eq!((footage.size(), footage.times().len()), ((64, 48), 50), "{name}");
        assert!((footage.rate() - 30.0).abs() < 0.05, "{name}: {}", footage.rate());
        let first = footage.times()[0];
        let is_even = footage.times().iter().enumerate().all(|(k, t)| (t - first - k as f64 / 30.0).abs() < 0.001);
        assert!(is_even && footage.has_times(), "{name}: {:?}", footage.times());
        assert!(footage.remarks().is_empty(), "{name}: {:?}", footage.remarks());
        assert_eq!(numbers(&footage), (0..50).collect::<Vec<_>>(), "{name}");
    }
}

#[test]
fn chosen_frames_are_those_of_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let footage = Footage::open(&film(folder.path(), "a.mp4", 30, H264)).unwrap();
    let mut frames = footage.frames_at(&[20, 3, 3, 99, 0]).unwrap();
    let found: Vec<(usize, u8)> =
        all(&mut frames).unwrap().into_iter().map(|(number, rgb)| (number, rgb[rgb.len() - 1])).collect();
    let close = |(number, grey): &(usize, u8)| (i32::from(*grey) - (4 * *number as i32 + 8)).abs() < 3;
    assert!(found.iter().map(|(number, _)| *number).eq([0, 3, 20]) && found.iter().all(close), "{found:?}");
    assert_eq!(frames.missing(), 0);
    assert!(all(&mut frames).unwrap().is_empty());
    assert!(all(&mut footage.frames_at(&[]).unwrap()).unwrap().is_empty());
}

#[test]
fn pictures_are_turned_as_the_camera_was_held() {
    let folder = tempfile::tempdir().unwrap();
    film(folder.path(), "flat.mp4", 4, H264);
    ffmpeg(folder.path(), "-i flat.mp4 -metadata:s:v rotate=270 -c copy turned.mp4");
    let footage = Footage::open(&folder.path().join("turned.mp4")).unwrap();
    assert_eq!(footage.size(), (48, 64));
    assert!(footage.remarks().iter().any(|remark| remark.contains("rotated by 90")), "{:?}", footage.remarks());
    let rgb = first(&footage);
    // By a quarter turn clockwise, as ffprobe says of this file: the upper left corner is now the upper right one.
    let red = |x: usize, y: usize| rgb[(y * 48 + x) * 3] > 150;
    assert_eq!([red(44, 4), red(4, 4), red(4, 60), red(44, 60)], [true, false, false, false]);
}

#[test]
fn uneven_times_and_missing_frames_are_told_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    // Without frames 10 and 11.
    let drops = format!("-vf select='not(between(n,10,11))' -fps_mode passthrough {H264}");
    let footage = Footage::open(&film(folder.path(), "a.mp4", 50, &drops)).unwrap();
    assert_eq!(footage.times().len(), 48);
    assert!((footage.times()[10] - 0.4).abs() < 1e-6 && (footage.rate() - 30.0).abs() < 1e-6);
    assert!(footage.remarks()[0].contains("2 frames are missing"), "{:?}", footage.remarks());
    let varies = format!(
        "-vf settb=1/1000,setpts='N/30/TB+mod(N,3)*0.01/TB' -fps_mode passthrough -enc_time_base 1:1000 {H264}"
    );
    let footage = Footage::open(&film(folder.path(), "b.mp4", 50, &varies)).unwrap();
    assert!(footage.remarks()[0].contains("varies"), "{:?}", footage.remarks());
    assert_eq!(numbers(&footage).len(), 50);
}

#[test]
fn what_is_readable_of_a_truncated_video_is_read_with_a_remark() {
    let folder = tempfile::tempdir().unwrap();
    for (name, options) in [("a.mp4", "-movflags +faststart"), ("a.mkv", "")] {
        let path = film(folder.path(), name, 60, &format!("{H264} -g 10 {options}"));
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() * 3 / 5]).unwrap();
        let footage = Footage::open(&path).unwrap();
        assert!((10..55).contains(&footage.times().len()), "{name}: {}", footage.times().len());
        assert!(footage.remarks()[0].contains("incomplete"), "{name}: {:?}", footage.remarks());
        let found = numbers(&footage);
        assert!(found.len() + 5 > footage.times().len() && found.iter().is_sorted(), "{name}: {found:?}");
    }
}

#[test]
fn damage_in_the_middle_leaves_the_numbers_of_the_other_frames() {
    let folder = tempfile::tempdir().unwrap();
    // Each frame by itself, so that damage stays in its frame.
    let path = film(folder.path(), "a.mp4", 40, "-c:v libx264 -crf 10 -pix_fmt yuv420p -g 1");
    let mut places = Command::new("ffprobe");
    places.args(["-v", "error", "-show_entries", "packet=pos,size", "-of", "csv=p=0"]);
    let places = String::from_utf8(places.arg(&path).output().unwrap().stdout).unwrap();
    let places: Vec<usize> = places.split([',', '\n']).filter_map(|word| word.trim().parse().ok()).collect();
    assert_eq!(places.len(), 80);
    let mut bytes = std::fs::read(&path).unwrap();
    for damaged in [7, 20, 21] {
        // ffprobe writes the size first.
        let [size, at] = [places[2 * damaged], places[2 * damaged + 1]];
        bytes[at..at + size].fill(0);
    }
    std::fs::write(&path, &bytes).unwrap();
    let footage = Footage::open(&path).unwrap();
    assert_eq!(footage.times().len(), 40);
    let expected: Vec<usize> = (0..40).filter(|k| ![7, 20, 21].contains(k)).collect();
    assert_eq!(numbers(&footage), expected);
    let mut frames = footage.frames_at(&[6, 7, 8, 21]).unwrap();
    let came: Vec<usize> = all(&mut frames).unwrap().into_iter().map(|(number, _)| number).collect();
    assert_eq!((came, frames.missing()), (vec![6, 8], 2));
}

#[test]
fn files_without_pictures_are_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("empty.mp4"), b"").unwrap();
    std::fs::write(at("text.mp4"), "not a film at all\n".repeat(100)).unwrap();
    std::fs::write(at("list.m3u8"), "#EXTM3U\n#EXTINF:5,\nhttp://127.0.0.1:9/a.ts\n").unwrap();
    ffmpeg(folder.path(), "-f lavfi -i sine=d=0.2 sound.wav");
    let whole = std::fs::read(film(folder.path(), "a.mp4", 30, H264)).unwrap();
    std::fs::write(at("headless.mp4"), &whole[..whole.len() / 2]).unwrap();
    std::fs::create_dir(at("nothing")).unwrap();
    std::fs::write(at("IMG_1.HEIC"), b"x").unwrap();
    for (name, expected) in [
        ("none.mp4", "cannot be read"),
        ("empty.mp4", "is empty"),
        ("text.mp4", "is not a video"),
        ("list.m3u8", "list.m3u8"),
        ("sound.wav", "has sound, but no pictures"),
        ("headless.mp4", "index at its end is missing"),
        ("nothing", "has no pictures"),
        ("IMG_1.HEIC", "ffmpeg -i IMG_1.HEIC IMG_1.png"),
    ] {
        let error = Footage::open(&at(name)).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains(expected) && error.lines().count() == 1, "{name}: {error}");
    }
}

#[test]
fn a_file_name_is_never_an_option_or_an_address() {
    let folder = tempfile::tempdir().unwrap();
    let film = film(folder.path(), "a.mp4", 3, H264);
    for name in ["-i.mp4", "http:b.mp4", "%03d.mp4", "two words'.mp4"] {
        let path = folder.path().join(name);
        std::fs::copy(&film, &path).unwrap();
        assert_eq!(numbers(&Footage::open(&path).unwrap()), [0, 1, 2], "{name}");
    }
}

#[test]
fn a_folder_of_pictures_is_footage() {
    let folder = tempfile::tempdir().unwrap();
    for (k, name) in ["frame-2.png", "frame-10.jpg", "frame-9.webp"].into_iter().enumerate() {
        RgbImage::from_pixel(8, 6, Rgb([40 * k as u8; 3])).save(folder.path().join(name)).unwrap();
    }
    std::fs::write(folder.path().join("notes.txt"), "x").unwrap();
    let footage = Footage::open(folder.path()).unwrap();
    assert_eq!((footage.size(), footage.times().len(), footage.has_times()), ((8, 6), 3, false));
    let names: Vec<String> = (0..3).map(|k| footage.name(k)).collect();
    assert_eq!(names, ["frame-2", "frame-9", "frame-10"]);
    let greys: Vec<u8> = all(&mut footage.frames().unwrap()).unwrap().iter().map(|(_, rgb)| rgb[0]).collect();
    assert_eq!(greys, [0, 80, 40]);
    assert_eq!(all(&mut footage.frames_at(&[2]).unwrap()).unwrap()[0].0, 2);
    let error = || all(&mut Footage::open(folder.path()).unwrap().frames().unwrap()).unwrap_err();
    RgbImage::new(5, 5).save(folder.path().join("frame-11.png")).unwrap();
    let refused = error();
    assert!(matches!(&refused, FootageError::Unusable { path, .. } if path.ends_with("frame-11.png")), "{refused}");
    assert!(refused.to_string().contains("5 x 5") && refused.to_string().contains("8 x 6"), "{refused}");
    std::fs::write(folder.path().join("frame-11.png"), b"no picture").unwrap();
    let refused = error();
    assert!(matches!(refused, FootageError::Picture { .. }), "{refused}");
}

#[test]
fn a_photograph_is_turned_by_its_exif() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jpg");
    let picture = RgbImage::from_fn(64, 32, |x, y| if x < 16 && y < 16 { Rgb([255, 0, 0]) } else { Rgb([0; 3]) });
    picture.save(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    // Orientation 6: the camera was held upright, and the picture must be turned clockwise.
    let exif = b"\xff\xe1\x00\x22Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    std::fs::write(&path, [&bytes[..2], exif, &bytes[2..]].concat()).unwrap();
    let footage = Footage::open(&path).unwrap();
    assert_eq!(footage.size(), (32, 64));
    let rgb = first(&footage);
    let red = |x: usize, y: usize| rgb[(y * 32 + x) * 3] > 150;
    assert_eq!([red(28, 4), red(4, 4), red(4, 60)], [true, false, false]);
    assert!(footage.remarks().is_empty());
}

#[test]
fn a_phones_video_states_the_focal_length_of_its_lens() {
    let folder = tempfile::tempdir().unwrap();
    let plain = film(folder.path(), "plain.mov", 10, H264);
    assert_eq!(Footage::open(&plain).unwrap().stated_focal(), None);
    // As an iPhone: keys in the film's track. ffmpeg does not write them, so they are put in.
    let boxed = |name: &[u8], inside: &[&[u8]]| {
        let inside = inside.concat();
        [&(inside.len() as u32 + 8).to_be_bytes()[..], name, &inside].concat()
    };
    let values: [(&str, u32, &[u8]); 2] = [
        ("com.apple.quicktime.camera.lens_model", 1, b"iPhone 14 back camera 5.7mm f/1.5"),
        ("com.apple.quicktime.camera.focal_length.35mm_equivalent", 67, &26u32.to_be_bytes()),
    ];
    let keys: Vec<u8> = values.iter().flat_map(|(name, ..)| boxed(b"mdta", &[name.as_bytes()])).collect();
    let item = |(k, (_, kind, value)): (u32, &(&str, u32, &[u8]))| {
        boxed(&k.to_be_bytes(), &[&boxed(b"data", &[&kind.to_be_bytes(), &[0; 4], value])])
    };
    let items: Vec<u8> = (1..).zip(&values).flat_map(item).collect();
    let handler = boxed(b"hdlr", &[&[0; 8], b"mdta", &[0; 12]]);
    let table = boxed(b"keys", &[&[0; 4], &2u32.to_be_bytes(), &keys]);
    let metadata = boxed(b"meta", &[&handler, &table, &boxed(b"ilst", &[&items])]);
    let mut bytes = std::fs::read(&plain).unwrap();
    // The only track is in the movie, which is behind the frames: their places stay.
    let place = |bytes: &[u8], name: &[u8]| bytes.windows(4).rposition(|four| four == name).unwrap() - 4;
    let [movie, track] = [b"moov", b"trak"].map(|name| place(&bytes, name));
    let length = |bytes: &[u8], at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    let end = track + length(&bytes, track) as usize;
    for at in [movie, track] {
        let longer = length(&bytes, at) + metadata.len() as u32;
        bytes[at..at + 4].copy_from_slice(&longer.to_be_bytes());
    }
    bytes.splice(end..end, metadata);
    let path = folder.path().join("phone.mov");
    std::fs::write(&path, bytes).unwrap();
    let footage = Footage::open(&path).unwrap();
    assert_eq!(numbers(&footage), (0..10).collect::<Vec<_>>());
    let focal = footage.stated_focal().unwrap();
    // 64 pixels of the width of a sensor of 4:3, whose diagonal is 80.
    assert!((focal.pixels - 26.0 / 43.267 * 80.0 * 1.1).abs() < 1e-9, "{focal:?}");
    assert!(focal.origin.contains("iPhone 14 back camera"), "{focal:?}");
}
