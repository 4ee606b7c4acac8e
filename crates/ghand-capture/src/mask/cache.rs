//! Cache of made masks: PNG files that end with a key of their inputs and the facts of their image. A changed pose,
//! camera, model or image invalidates them.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use ghand_files::atomic_file::write_atomically;
use glam::DVec3;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::{Facts, MadeMasks};
use crate::capture::{Capture, fill_template};
use crate::error::CaptureError;
use crate::images::file::{Role, decode, read_bytes};

/// Data after the PNG: this tag, the key, the facts. Changes whenever masks are made in another way.
const MARK: [u8; 8] = *b"ghandms3";
/// Lengths: tag, key, pixels, two brightnesses.
const TRAILER: usize = 8 + 8 + 4 + 1 + 1;

/// The file of a mask, and the inputs that it must have been made from.
pub(super) struct MaskFile {
    file: PathBuf,
    key: u64,
    size: (u32, u32),
}

/// The content of that file.
pub(super) struct Stored {
    pub facts: Facts,
    file: PathBuf,
    png: Vec<u8>,
    size: (u32, u32),
}

impl MaskFile {
    /// `image` are the bytes of the image's file, `mask` those of its mask's if it has one. `made_from` tells apart what
    /// else it is made from.
    pub fn new(
        capture: &Capture,
        camera: usize,
        frame: usize,
        image: &[u8],
        mask: Option<&[u8]>,
        made_from: u64,
    ) -> Result<MaskFile, CaptureError> {
        // One that cannot be read is told where the mask is made.
        let other_hands = capture.other_hands_file(camera, frame)?.and_then(|file| std::fs::read(file).ok());
        let (camera, frame) = capture.camera_and_frame(camera, frame)?;
        let mut hasher = DefaultHasher::new();
        other_hands.hash(&mut hasher);
        let mut add = |values: &[DVec3]| {
            values.len().hash(&mut hasher);
            values.iter().flat_map(DVec3::to_array).for_each(|v| v.to_bits().hash(&mut hasher));
        };
        add(&capture.hand_model.vertices);
        add(&capture.hand_model.joints);
        add(&frame.pose.rotations);
        add(&[frame.pose.translation, camera.translation, camera.focal.extend(0.0), camera.principal.extend(0.0)]);
        add(&[camera.rotation.x_axis, camera.rotation.y_axis, camera.rotation.z_axis]);
        frame.shape.iter().for_each(|v| v.to_bits().hash(&mut hasher));
        (&capture.hand_model.faces, camera.width, camera.height, image, mask, made_from).hash(&mut hasher);
        // Masks made from aligned poses do not replace those from the given ones, which are needed again first.
        let poses = if capture.images.aligned.is_some() { "aligned" } else { "" };
        let folder = capture.images.made_masks.as_ref().map(MadeMasks::folder).unwrap_or_default().join(poses);
        // Without a sequence this begins with a slash, which would mean the root of the file system.
        let name = fill_template("{sequence}/{camera}/{number}.png", &camera.id, &frame.id);
        let file = folder.join(name.trim_start_matches('/'));
        Ok(MaskFile { file, key: hasher.finish(), size: (camera.width, camera.height) })
    }

    /// The cached content, if it was made from the same inputs.
    pub fn read(&self) -> Option<Stored> {
        let mut png = read_bytes(&self.file, Role::Mask, self.size).ok()?;
        let trailer = png.split_off(png.len().checked_sub(TRAILER)?);
        let (mark, rest) = trailer.split_first_chunk::<8>()?;
        let (key, rest) = rest.split_first_chunk::<8>()?;
        let (pixels, rest) = rest.split_first_chunk::<4>()?;
        let &[brightest, brightest_on_hand] = rest else { return None };
        if *mark != MARK || u64::from_le_bytes(*key) != self.key {
            return None;
        }
        let facts = Facts { mask_pixels: u32::from_le_bytes(*pixels), brightest, brightest_on_hand };
        Some(Stored { facts, file: self.file.clone(), png, size: self.size })
    }

    /// Stores the facts, and the mask unless it has its own file. Data that cannot be stored are made again next time.
    pub fn write(&self, facts: &Facts, mask: Option<&[u8]>) {
        static WARNED: AtomicBool = AtomicBool::new(false);
        let mut bytes = Vec::new();
        let encoded = match mask {
            Some(mask) => PngEncoder::new(&mut bytes)
                .write_image(mask, self.size.0, self.size.1, ExtendedColorType::L8)
                .map_err(std::io::Error::other),
            None => Ok(()),
        };
        bytes.extend(MARK);
        bytes.extend(self.key.to_le_bytes());
        bytes.extend(facts.mask_pixels.to_le_bytes());
        bytes.extend([facts.brightest, facts.brightest_on_hand]);
        let folder = self.file.parent().unwrap_or(Path::new("."));
        let written =
            encoded.and_then(|()| std::fs::create_dir_all(folder)).and_then(|()| write_atomically(&self.file, &bytes));
        if let Err(error) = written
            && !WARNED.swap(true, Ordering::Relaxed)
        {
            log::warn!("{}: masks cannot be cached and are made again each time: {error}", self.file.display());
        }
    }
}

impl Stored {
    /// The mask, if it was made and its file is intact.
    pub fn mask(&self) -> Option<Vec<u8>> {
        Some(decode(&self.file, Role::Mask, &self.png, self.size).ok()?.into_luma8().into_raw())
    }
}

/// A folder for the masks of a data set: beside it if that is writable, else in the user's cache.
pub(super) fn mask_folder(root: &Path) -> PathBuf {
    let beside = root.join("ghand-masks");
    let may_write = std::fs::create_dir_all(&beside).is_ok() && tempfile::tempfile_in(&beside).is_ok();
    if may_write {
        return beside;
    }
    let variable = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let cache = variable("XDG_CACHE_HOME")
        .or_else(|| variable("LOCALAPPDATA"))
        .or_else(|| std::env::home_dir().map(|home| home.join(".cache")))
        .unwrap_or_else(std::env::temp_dir);
    let mut hasher = DefaultHasher::new();
    std::fs::canonicalize(root).unwrap_or_else(|_| root.to_path_buf()).hash(&mut hasher);
    cache.join("ghand").join("masks").join(format!("{:016x}", hasher.finish()))
}
