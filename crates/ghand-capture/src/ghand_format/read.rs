//! Reads and checks `capture.json`.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_hand_model::HandModelError;
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::files::mano::PARENTS as MANO_PARENTS;
use ghand_hand_model::files::read::read_gltf_hand;

use super::fields::read_fields;
use super::{CaptureFile, FORMAT, FrameFile, HandModelFile, HeaderFile, MADE, SplitFile, UNITS, VERSION};
use crate::cameras::distortion::Distortion;
use crate::cameras::file::{CameraFile, principal_shift};
use crate::capture::{Capture, CaptureError, Frame, HandModelSource, ImagePaths, Split, mean_shaped};
use crate::images::file::has_alpha;
use crate::mask::{MadeMasks, MaskMethod};
use crate::reading::json_file::{LARGEST_FILE, parse};
use crate::reading::text_file::read_text;
use crate::reading::validation::{FileValidator, JointRows};
use crate::truth::{TRUTH_FILE, read_truth};

/// Most images of all splits together; the largest data sets have a few million.
const MOST_VIEWS: usize = 1 << 23;

/// Reads a `capture.json`, with oddities of its hand model. Of the images, at most one header is read: masks are made for a capture without masks whose
/// images have no alpha channel. `mano` is the user's MANO model, for captures whose poses are MANO's.
///
/// # Errors
/// [`CaptureError`] names the file, the missing or wrong field, and what to do.
pub(crate) fn read_capture(path: &Path, mano: Option<&HandModel>) -> Result<(Capture, Vec<String>), CaptureError> {
    let remedy = "give the folder of a capture (with its capture.json), InterHand2.6M or one of its folders Capture0, \
                  Capture1 and so on, or a subject of the Hand Appearance dataset";
    let text = read_text(path, LARGEST_FILE, "read the capture", remedy)?;
    let (mut capture, warnings) = read_text_with_warnings(path, &text, mano)?;
    if capture.images.mask.is_none() && capture.images.made_masks.is_none() && lacks_alpha(&capture) {
        capture.images.made_masks = Some(MadeMasks::new(MaskMethod::Colors, capture.root.clone(), PathBuf::new()));
    }
    Ok((capture, warnings))
}

/// Whether the first image has no alpha channel. One that cannot be read is reported when it is needed.
fn lacks_alpha(capture: &Capture) -> bool {
    let first = || {
        let view = capture.splits.values().find_map(|split| split.views.first())?;
        let camera = capture.cameras.get(view.camera)?;
        has_alpha(&capture.image_file(view.camera, view.frame).ok()?, (camera.width, camera.height))
    };
    first() == Some(false)
}

/// Reads the text of a `capture.json`; the path is for messages and for the files beside it.
///
/// # Errors
/// As for [`Capture::open`].
pub fn read_capture_text(path: &Path, text: &str, mano: Option<&HandModel>) -> Result<Capture, CaptureError> {
    read_text_with_warnings(path, text, mano).map(|(capture, _)| capture)
}

fn read_text_with_warnings(
    path: &Path,
    text: &str,
    mano: Option<&HandModel>,
) -> Result<(Capture, Vec<String>), CaptureError> {
    let reader = Reader { validator: FileValidator { path }, mano };
    reader.header(text)?;
    let mut warnings = vec![];
    let capture = reader.capture(read_fields(path, text)?, &mut warnings)?;
    Ok((capture, warnings))
}

/// Reads one file.
struct Reader<'a> {
    validator: FileValidator<'a>,
    mano: Option<&'a HandModel>,
}

impl Reader<'_> {
    fn invalid(&self, field: impl Into<String>, problem: impl Into<String>) -> CaptureError {
        self.validator.invalid(field, problem)
    }

    fn header(&self, text: &str) -> Result<(), CaptureError> {
        let header: HeaderFile = parse(self.validator.path, text)?;
        match header.format.as_deref() {
            Some(FORMAT) => {}
            other => {
                let found = other.map_or("nothing".into(), |o| format!("{o:?}"));
                return Err(self.invalid("format", format!("is {found}, must be {FORMAT:?}; give a ghand capture")));
            }
        }
        match header.version {
            Some(VERSION) => Ok(()),
            Some(v) if v > VERSION => {
                let problem = format!("is {v}, this program reads version {VERSION}; use a newer program");
                Err(self.invalid("version", problem))
            }
            other => {
                let found = other.map_or("missing".into(), |v| format!("{v}"));
                Err(self.invalid("version", format!("is {found}, must be {VERSION}; export the capture again")))
            }
        }
    }

    fn capture(&self, file: CaptureFile, warnings: &mut Vec<String>) -> Result<Capture, CaptureError> {
        let root = match self.validator.path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        if file.units != UNITS {
            let problem = format!("is {:?}, must be {UNITS:?}; convert all lengths to metres", file.units);
            return Err(self.invalid("units", problem));
        }
        let side = match file.side.as_str() {
            "right" => Side::Right,
            "left" => Side::Left,
            other => return Err(self.invalid("side", format!("is {other:?}, must be \"right\" or \"left\""))),
        };
        if !file.background.iter().all(|v| (0.0..=1.0).contains(v)) {
            let problem = format!("is {:?}; each component must be from 0 to 1", file.background);
            return Err(self.invalid("background", problem));
        }
        let (hand_model, hand_model_source) = self.hand_model(&root, &file.hand_model, side, warnings)?;
        let joint_order = self.joint_order(&file.hand_model, &hand_model)?;
        let joints = JointRows { order: &joint_order, names: &hand_model.joint_names };

        let shift = principal_shift(self.validator, file.pixel_center)?;
        let mut cameras = file.cameras.iter().map(|c| self.camera(c)).collect::<Result<Vec<_>, _>>()?;
        cameras.iter_mut().for_each(|camera| camera.principal += shift);
        let distortion = self.distortion(&file.cameras, &cameras)?;
        let camera_indices = self.validator.index("cameras", cameras.iter().map(|c| c.id.as_str()))?;
        let frames = file.frames.iter().map(|f| self.frame(f, joints)).collect::<Result<Vec<_>, _>>()?;
        let frame_indices = self.validator.index("frames", frames.iter().map(|f| f.id.as_str()))?;
        let shapes = frames.first().map_or(0, |f| f.shape.len());
        if let Some(odd) = frames.iter().find(|f| f.shape.len() != shapes) {
            let problem = format!("has {} numbers, the first frame has {shapes}; give all the same", odd.shape.len());
            return Err(self.invalid(format!("frames[{:?}].shape", odd.id), problem));
        }

        if let Some(odd) = frames.iter().find(|f| f.shape.len() > hand_model.shape_count()) {
            let problem =
                format!("has {shapes} numbers, the hand model takes {}; leave it empty", hand_model.shape_count());
            return Err(self.invalid(format!("frames[{:?}].shape", odd.id), problem));
        }
        let template = mean_shaped(&hand_model, &frames).map_err(|source| self.hand_model_error(source))?;

        let mut images = ImagePaths::plain(&file.image_path, file.mask_path.as_deref());
        images.other_hands.clone_from(&file.other_hands_path);
        match file.masks.as_deref() {
            None => {}
            Some(MADE) => images.made_masks = Some(MadeMasks::new(MaskMethod::Colors, root.clone(), PathBuf::new())),
            Some(other) => {
                let problem = format!(
                    "is {other:?}, must be {MADE:?}, so that masks are made for images without any; paths of masks \
                     belong into mask_path"
                );
                return Err(self.invalid("masks", problem));
            }
        }
        self.templates(&images, &camera_indices, &frame_indices)?;
        let mut views_left = MOST_VIEWS;
        let splits = (file.splits.into_iter())
            .map(|(name, split)| {
                let split = self.split(&name, &split, &camera_indices, &frame_indices, &mut views_left)?;
                Ok((name, split))
            })
            .collect::<Result<BTreeMap<_, _>, CaptureError>>()?;
        let truth = self.truth(&root.join(TRUTH_FILE), &frame_indices, joints)?;
        Ok(Capture {
            root,
            side,
            background: file.background,
            hand_model,
            hand_model_source,
            template,
            cameras,
            distortion,
            color_correction: Default::default(),
            frames,
            images,
            splits,
            truth,
        })
    }

    fn hand_model(
        &self,
        root: &Path,
        file: &HandModelFile,
        side: Side,
        warnings: &mut Vec<String>,
    ) -> Result<(HandModel, HandModelSource), CaptureError> {
        if file.path.is_some() && file.kind != "gltf" {
            let problem =
                format!("belongs to a hand model of kind \"gltf\", but this one is {:?}; remove it", file.kind);
            return Err(self.invalid("hand_model.path", problem));
        }
        let (model, source) = match file.kind.as_str() {
            "gltf" => {
                let Some(path) = &file.path else {
                    return Err(
                        self.invalid("hand_model.path", "is missing; give the glTF or GLB file beside the capture")
                    );
                };
                self.validator.is_inside_capture("hand_model.path", path)?;
                let file =
                    read_gltf_hand(&root.join(path), Some(side)).map_err(|source| self.hand_model_error(source))?;
                warnings.extend(file.warnings.iter().map(|warning| format!("{path}: {warning}")));
                (file.model, HandModelSource::Gltf { path: path.clone() })
            }
            "builtin" => {
                let model = builtin_hand(side).map_err(|source| self.hand_model_error(source))?;
                (model, HandModelSource::Builtin)
            }
            "mano" => match self.mano {
                Some(model) if model.parents == MANO_PARENTS => (model.clone(), HandModelSource::Mano),
                Some(model) => {
                    let problem = format!(
                        "is \"mano\" but {} is not a MANO model; give MANO_RIGHT.pkl or MANO_LEFT.pkl",
                        model.name
                    );
                    return Err(self.invalid("hand_model.kind", problem));
                }
                None => {
                    let problem = "is \"mano\": give your own MANO_RIGHT.pkl or MANO_LEFT.pkl with --hand-model";
                    return Err(self.invalid("hand_model.kind", problem));
                }
            },
            other => {
                let problem = format!("is {other:?}; must be \"builtin\", \"gltf\" or \"mano\"");
                return Err(self.invalid("hand_model.kind", problem));
            }
        };
        model.validate().map_err(|source| self.hand_model_error(source.into()))?;
        if model.side != side {
            let problem =
                format!("is a {:?} hand but side says {side:?}; correct one of them", model.side).to_lowercase();
            return Err(self.invalid("hand_model", problem));
        }
        Ok((model, source))
    }

    /// The row in the file's poses of each joint of the model.
    fn joint_order(&self, file: &HandModelFile, model: &HandModel) -> Result<Vec<usize>, CaptureError> {
        let Some(names) = &file.joints else {
            if file.parents.is_some() {
                let problem = "is missing although there are parents; name their joints";
                return Err(self.invalid("hand_model.joints", problem));
            }
            return Ok((0..model.joint_count()).collect());
        };
        let rows = self.validator.index("hand_model.joints", names.iter().map(String::as_str))?;
        if let Some(unknown) = names.iter().find(|name| model.joint_index(name).is_none()) {
            let known = model.joint_names.join(", ");
            let problem = format!("{unknown:?} is not a joint of the hand model; its joints are: {known}");
            return Err(self.invalid("hand_model.joints", problem));
        }
        let order = (model.joint_names.iter())
            .map(|name| {
                rows.get(name.as_str()).copied().ok_or_else(|| {
                    let problem = format!("the model's joint {name:?} is not listed; add it and its row in every pose");
                    self.invalid("hand_model.joints", problem)
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        if let Some(parents) = &file.parents {
            self.parents(parents, names, model)?;
        }
        Ok(order)
    }

    fn parents(&self, parents: &[i64], names: &[String], model: &HandModel) -> Result<(), CaptureError> {
        if parents.len() != names.len() {
            let problem = format!("has {} entries for {} joints; give one each", parents.len(), names.len());
            return Err(self.invalid("hand_model.parents", problem));
        }
        for (name, &parent) in names.iter().zip(parents) {
            let given = match parent {
                -1 => None,
                p => match usize::try_from(p).ok().and_then(|p| names.get(p)) {
                    Some(parent) => Some(parent.as_str()),
                    None => {
                        let problem = format!("joint {name:?} has parent {p}; must be -1 or an index into joints");
                        return Err(self.invalid("hand_model.parents", problem));
                    }
                },
            };
            let parent_index = model.joint_index(name).and_then(|j| model.parents.get(j).copied().flatten());
            let actual = parent_index.and_then(|p| model.joint_names.get(p)).map(String::as_str);
            if given != actual {
                let problem = format!(
                    "joint {name:?} has the parent {} here but {} in the hand model; use the model's hierarchy",
                    given.unwrap_or("nothing"),
                    actual.unwrap_or("nothing")
                );
                return Err(self.invalid("hand_model.parents", problem));
            }
        }
        Ok(())
    }

    fn camera(&self, file: &CameraFile) -> Result<Camera, CaptureError> {
        file.camera(self.validator, format!("cameras[{:?}]", file.id))
    }

    /// The cameras' distortion; empty if none has any.
    fn distortion(&self, files: &[CameraFile], cameras: &[Camera]) -> Result<Vec<Option<Distortion>>, CaptureError> {
        let found = files
            .iter()
            .zip(cameras)
            .map(|(file, camera)| file.distortion(self.validator, &format!("cameras[{:?}]", file.id), camera));
        let found = found.collect::<Result<Vec<_>, _>>()?;
        Ok(if found.iter().any(Option::is_some) { found } else { vec![] })
    }

    fn frame(&self, file: &FrameFile, joints: JointRows) -> Result<Frame, CaptureError> {
        let pose = self.validator.pose(&file.id, &file.pose, file.translation, joints)?;
        self.validator.pose_range(&file.id, &pose, &file.shape, joints.names)?;
        Ok(Frame { id: file.id.clone(), pose, shape: file.shape.clone() })
    }

    fn split(
        &self,
        name: &str,
        file: &SplitFile,
        cameras: &HashMap<&str, usize>,
        frames: &HashMap<&str, usize>,
        views_left: &mut usize,
    ) -> Result<Split, CaptureError> {
        let look_up = |what: &str, ids: &[String], index: &HashMap<&str, usize>| {
            let field = format!("splits[{name:?}].{what}");
            self.validator.index(&field, ids.iter().map(String::as_str))?;
            let found = ids.iter().map(|id| {
                let unknown = || self.invalid(field.clone(), format!("{id:?} is not among the capture's {what}"));
                index.get(id.as_str()).copied().ok_or_else(unknown)
            });
            found.collect::<Result<Vec<_>, _>>()
        };
        let cameras = look_up("cameras", &file.cameras, cameras)?;
        let frames = look_up("frames", &file.frames, frames)?;
        // A short file can name far more pairs than fit into memory.
        let left = cameras.len().checked_mul(frames.len()).and_then(|views| views_left.checked_sub(views));
        *views_left = left.ok_or_else(|| {
            let [cameras, frames] = [cameras.len(), frames.len()];
            let problem = format!(
                "has {cameras} cameras with {frames} frames each, but all splits together may have at most \
                 {MOST_VIEWS} images; list fewer"
            );
            self.invalid(format!("splits[{name:?}]"), problem)
        })?;
        Ok(Split::product(cameras, frames))
    }

    fn templates(
        &self,
        images: &ImagePaths,
        cameras: &HashMap<&str, usize>,
        frames: &HashMap<&str, usize>,
    ) -> Result<(), CaptureError> {
        let templates = [
            ("image_path", Some(&images.image)),
            ("mask_path", images.mask.as_ref()),
            ("other_hands_path", images.other_hands.as_ref()),
        ];
        for (field, template) in templates.into_iter().filter_map(|(field, t)| Some((field, t?))) {
            self.validator.is_inside_capture(field, template)?;
            for (placeholder, count) in [("{camera}", cameras.len()), ("{frame}", frames.len())] {
                if count > 1 && !template.contains(placeholder) {
                    let problem =
                        format!("{template:?} does not contain {placeholder}: all {count} would share one file");
                    return Err(self.invalid(field, problem));
                }
            }
        }
        for (field, ids) in [("cameras", cameras), ("frames", frames)] {
            for id in ids.keys() {
                self.validator.id(field, id)?;
            }
        }
        Ok(())
    }

    /// Exact poses by frame, if the file exists.
    fn truth(
        &self,
        path: &Path,
        frames: &HashMap<&str, usize>,
        joints: JointRows,
    ) -> Result<Option<Vec<Option<Pose>>>, CaptureError> {
        let Some(poses) = read_truth(path, joints)? else { return Ok(None) };
        let mut truth = vec![None; frames.len()];
        for (id, pose) in poses {
            let slot = frames.get(id.as_str()).and_then(|&i| truth.get_mut(i)).ok_or_else(|| {
                FileValidator { path }.invalid("frames", format!("{id:?} is not among the capture's frames; remove it"))
            })?;
            *slot = Some(pose);
        }
        Ok(Some(truth))
    }

    fn hand_model_error(&self, source: HandModelError) -> CaptureError {
        CaptureError::HandModel { path: self.validator.path.into(), source }
    }
}
