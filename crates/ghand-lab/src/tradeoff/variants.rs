//! The variants of avatars that are compared.

use std::path::Path;
use std::sync::Arc;

use ghand_avatar::deform::baked::Precision;
use ghand_avatar::{Avatar, AvatarConfig, Bake, PropertyTables};
use ghand_capture::Capture;
use ghand_core::Pose;
use ghand_render::Gpu;
use ghand_render::splat::Thresholds;

use ghand_app::baked::RANK;
use ghand_app::commands::bake::pose_set::PoseSet;
use ghand_app::commands::bake::pose_set_args::PoseSetArgs;
use ghand_app::say;

/// An avatar in one of its forms.
pub struct Variant {
    /// A name for people.
    pub name: String,
    /// What differs from the exact avatar: a knob.
    pub knob: &'static str,
    /// The avatar.
    pub avatar: Arc<Avatar>,
    /// The picture is drawn at this part of its width and height, and enlarged.
    pub image_scale: f64,
    /// Which contributions the splatter skips.
    pub thresholds: Thresholds,
    /// Size of its file, bytes.
    pub bytes: usize,
}

/// The knobs, in the order of legends.
pub const KNOBS: [&str; 6] = ["exact", "baked", "precision", "antialias", "cut-offs", "image scale"];

/// Parts of the blocks that baked variants keep.
const KEPT: [(usize, usize); 5] = [(1, 1), (1, 4), (1, 16), (1, 64), (0, 1)];
/// Most components of a joint.
const RANKS: [usize; 2] = [RANK, 2];
/// Image scales below 1.
const SCALES: [f64; 2] = [0.75, 0.5];
/// Coarser thresholds of the splatter: 255ths of alpha, and bits of depth.
const ALPHAS: [u32; 3] = [2, 4, 8];
const DEPTH_BITS: [u32; 2] = [20, 10];

/// A short name for the avatar of a file, unique among `count`.
pub fn short_name(path: &Path, count: usize) -> String {
    let name =
        |part: Option<&std::ffi::OsStr>| part.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    // Avatars of runs are all called avatar.ghand.
    let stem = name(path.file_stem());
    let folder = path.parent().map(|folder| name(folder.file_name())).filter(|folder| !folder.is_empty());
    match folder {
        _ if count == 1 => String::new(),
        Some(folder) if stem == "avatar" => folder,
        _ => stem,
    }
}

/// All variants of the avatars; of those that are baked already only what does not bake them.
///
/// # Errors
/// An error if the poses are too few or the device failed.
pub fn variants(
    gpu: &Gpu,
    avatars: &[(String, Avatar)],
    poses: &PoseSetArgs,
    capture: &Capture,
    split: &str,
) -> anyhow::Result<Vec<Variant>> {
    let mut all = vec![];
    for (file, avatar) in avatars {
        let exact = Arc::new(avatar.clone());
        let mut add_with =
            |text: String, knob: &'static str, avatar: &Arc<Avatar>, image_scale: f64, thresholds: Thresholds| {
                let name = if file.is_empty() { text } else { format!("{file}: {text}") };
                let bytes = avatar.file_size()?;
                all.push(Variant { name, knob, bytes, avatar: avatar.clone(), image_scale, thresholds });
                anyhow::Ok(())
            };
        add_with("exact".into(), "exact", &exact, 1.0, Thresholds::default())?;
        for alpha in ALPHAS {
            let thresholds = Thresholds { alpha, ..Thresholds::default() };
            add_with(format!("alpha from {alpha}/255"), "cut-offs", &exact, 1.0, thresholds)?;
        }
        for depth_bits in DEPTH_BITS {
            let thresholds = Thresholds { depth_bits, ..Thresholds::default() };
            add_with(format!("{depth_bits} bits of depth"), "cut-offs", &exact, 1.0, thresholds)?;
        }
        let mut add = |text: String, knob: &'static str, avatar: &Arc<Avatar>, image_scale: f64| {
            add_with(text, knob, avatar, image_scale, Thresholds::default())
        };
        let antialias = !avatar.config.antialias;
        let config = AvatarConfig { antialias, narrow_blur: antialias, ..avatar.config.clone() };
        let other = Arc::new(Avatar { config, ..avatar.clone() });
        add(format!("antialias {}", if antialias { "on" } else { "off" }), "antialias", &other, 1.0)?;
        for scale in SCALES {
            add(format!("image x {scale}"), "image scale", &exact, scale)?;
        }
        if matches!(avatar.tables, PropertyTables::Baked(_)) {
            continue;
        }
        let set = PoseSet::gather(&poses.read(&avatar.model)?, avatar, Some((capture, split)))?;
        let fitted: Vec<Pose> = set.fitted.into_iter().map(|named| named.pose).collect();
        for rank in RANKS {
            say!("baking {file} with {rank} components a joint over {} poses", fitted.len());
            let bake = Bake::new(gpu, avatar, &fitted, rank, |_| ())?;
            let make = |keep: usize, precision: Precision| Arc::new(bake.avatar(keep, precision));
            if rank != RANKS[0] {
                add(format!("baked, rank {rank}"), "baked", &make(bake.blocks(), Precision::U8), 1.0)?;
                continue;
            }
            for (part, of) in KEPT {
                let text = match (part, of) {
                    (1, 1) => "baked, all".to_owned(),
                    (0, _) => "baked, mean only".into(),
                    _ => format!("baked, {part}/{of}"),
                };
                let kept = part as f64 / of as f64;
                let baked = make((kept * bake.blocks() as f64).round() as usize, Precision::U8);
                add(text, "baked", &baked, 1.0)?;
                if (part, of) == (1, 16) {
                    for scale in SCALES {
                        add(format!("baked, {part}/{of}, image x {scale}"), "image scale", &baked, scale)?;
                    }
                }
            }
            for (name, precision) in [("f16", Precision::F16), ("f32", Precision::F32)] {
                add(format!("baked, all, {name}"), "precision", &make(bake.blocks(), precision), 1.0)?;
            }
        }
    }
    Ok(all)
}
