//! Films all videos and writes the truth.

use std::path::Path;

use ghand_capture::CaptureError;
use ghand_capture::cameras::list::{LensCamera, write_cameras};
use ghand_core::Camera;
use ghand_pictures::{Ffmpeg, VideoOptions, start_video};
use image::ExtendedColorType;

use super::board::Board;
use super::clock::Clock;
use super::exposure::{FilmCamera, Scene};
use super::room::Room;
use super::subject::Subject;
use super::truth::Truth;
use super::{FootageOptions, MASK_EVERY};
use crate::images::draw::write_image;
use crate::images::lighting::lighting;
use crate::make_footage::FootageError;
use crate::new_folder::make_folder;
use crate::{LightSetup, RenderScene};

/// Is told how many frames of how many are done.
type Progress<'a> = dyn FnMut(usize, usize) + 'a;

/// Films everything into a new folder. Returns the number of frames.
///
/// # Errors
/// [`FootageError`] if the options are unusable, ffmpeg is missing, the folder cannot be written, or `render` fails.
pub(crate) fn record(
    options: &FootageOptions,
    folder: &Path,
    render: &mut RenderScene,
    progress: &mut Progress,
) -> Result<usize, FootageError> {
    options.check(folder)?;
    let clocks = Clock::all(options);
    let all = clocks.iter().map(Clock::frames).sum();
    let size = [options.width, options.height];
    let start = |clock: &Clock| start_video(&VideoOptions { size, rate: clock.rate, lost: clock.lost.clone() });
    // Without ffmpeg this ends here, before the work.
    let videos: Vec<Ffmpeg> = clocks.iter().map(start).collect::<Result<_, _>>()?;
    let subject = Subject::random(options).map_err(|source| CaptureError::HandModel { path: folder.into(), source })?;
    let room = Room::furnished(options.seed);
    let cameras = FilmCamera::all(options, clocks, &room);
    let board = Board::of(options);
    let lighting = lighting(LightSetup::Soft);
    let scene = Scene { subject: &subject, room: &room, lighting: &lighting, board: board.as_ref() };
    let mut done = 0;
    make_folder(folder, |workshop| {
        Truth::of(&subject, &cameras, options.side, board.as_ref()).write(&workshop.join("truth.json"))?;
        write_cameras(&workshop.join("cameras.json"), &true_cameras(&cameras))?;
        for (camera, mut video) in cameras.iter().zip(videos) {
            for frame in 0..camera.clock.frames() {
                let (rgb, mask) = scene.frame(camera, frame, frame % MASK_EVERY == 0, render)?;
                video.send(&rgb)?;
                if let Some(mask) = mask {
                    write_mask(workshop, &camera.at(0.0).camera, frame, &mask)?;
                }
                done += 1;
                progress(done, all);
            }
            video.write(&workshop.join(format!("{}.mp4", camera.id)))?;
        }
        Ok::<(), FootageError>(())
    })?;
    Ok(all)
}

/// The cameras; of one that moves, one for each of its frames.
fn true_cameras(cameras: &[FilmCamera]) -> Vec<LensCamera> {
    let of = |camera: &FilmCamera| -> Vec<LensCamera> {
        if camera.is_standing() {
            return vec![camera.at(0.0)];
        }
        let in_frame = |frame: usize| {
            let LensCamera { camera: seen, distortion } = camera.at(camera.clock.time(frame));
            LensCamera { camera: Camera { id: format!("{}-{frame:04}", camera.id), ..seen }, distortion }
        };
        (0..camera.clock.frames()).map(in_frame).collect()
    };
    cameras.iter().flat_map(of).collect()
}

fn write_mask(folder: &Path, camera: &Camera, frame: usize, mask: &[bool]) -> Result<(), CaptureError> {
    let path = folder.join("truth-masks").join(&camera.id).join(format!("{frame:04}.png"));
    let values: Vec<u8> = mask.iter().map(|inside| if *inside { 255 } else { 0 }).collect();
    write_image(&path, "mask", &values, camera, ExtendedColorType::L8)
}
