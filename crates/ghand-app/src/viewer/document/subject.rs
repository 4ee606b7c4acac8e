//! What the viewer shows: a hand that can be posed, or a static scene.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, bail};
use egui::Ui;
use ghand_avatar::framing::posed_vertices;
use ghand_avatar::scene_files::SplatScene;
use ghand_avatar::{Avatar, Light};
use ghand_core::{HandModel, Pose};
use ghand_files::input_file;
use ghand_hand_model::files::mano::LeftShapes;

use crate::file_kind::{FileKind, file_kind};
use crate::hand_model_file::{is_hand_name, load_hand_model};
use crate::lighting::Lighting;
use crate::viewer::document::scene::read_scene;
use crate::viewer::hand::Hand;
use crate::viewer::rendering::drawn_subject::DrawnSubject;
use ghand_avatar::orbit_camera::OrbitCamera;

/// What the viewer shows.
pub enum Subject {
    /// A hand.
    Hand(Box<Hand>),
    /// A scene of Gaussians, as returned by [`read_scene`].
    Scene {
        /// The Gaussians.
        gaussians: Arc<SplatScene>,
        /// The scene's name.
        name: String,
    },
}

impl Subject {
    /// Reads an avatar, which is put into a light, a scene of Gaussians or a hand model, recognised from its contents.
    ///
    /// # Errors
    /// One sentence that names the file, and the invalid part or the expected kind of file.
    pub fn read(path: &Path, light: &Lighting) -> anyhow::Result<Subject> {
        let subject = Subject::read_file(path, light)?;
        if subject.light().is_none() && !light.is_default() {
            bail!("--light: {} is not an avatar with a light of its own", path.display());
        }
        Ok(subject)
    }

    fn read_file(path: &Path, light: &Lighting) -> anyhow::Result<Subject> {
        if is_hand_name(path) {
            return Subject::hand_model(path);
        }
        input_file::open(path).with_context(|| format!("{}: cannot be read", path.display()))?;
        match file_kind(path) {
            FileKind::Avatar => {
                let mut avatar = Avatar::load(path)?;
                light.apply_to(&mut avatar)?;
                Ok(Subject::avatar(avatar))
            }
            FileKind::Scene => {
                let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
                Ok(Subject::Scene { gaussians: Arc::new(read_scene(path)?), name })
            }
            FileKind::HandModel => Subject::hand_model(path),
            FileKind::Other => bail!(
                "{}: is neither an avatar (.ghand), nor a scene of Gaussians (.ply), nor a hand model (.glb, .gltf, or \
                 a MANO .pkl or .npz)",
                path.display()
            ),
        }
    }

    fn hand_model(path: &Path) -> anyhow::Result<Subject> {
        let file = load_hand_model(path, LeftShapes::Fixed)?;
        for warning in &file.warnings {
            log::warn!("{}: {warning}", path.display());
        }
        Ok(Subject::bare_hand(file.model))
    }

    /// A hand model without an avatar, at rest.
    pub fn bare_hand(model: HandModel) -> Subject {
        Subject::Hand(Box::new(Hand::bare(model)))
    }

    /// An avatar at rest.
    pub fn avatar(avatar: Avatar) -> Subject {
        Subject::Hand(Box::new(Hand::new(avatar)))
    }

    /// What is drawn of it.
    pub fn drawn(&self) -> DrawnSubject {
        match self {
            Subject::Hand(hand) => hand.drawn(),
            Subject::Scene { gaussians, .. } => DrawnSubject::Scene(gaussians.clone()),
        }
    }

    /// The subject's name.
    pub fn name(&self) -> String {
        match self {
            Subject::Hand(hand) => hand.name(),
            Subject::Scene { name, .. } => name.clone(),
        }
    }

    /// The initial view of it: in its present pose, or, while a motion is shown, at rest, because the flat hand must fit.
    pub fn first_view(&self) -> OrbitCamera {
        match self {
            Subject::Hand(hand) => {
                let model = hand.model();
                if hand.timeline.is_some() {
                    let rest = Pose::rest(model.joint_count());
                    OrbitCamera::facing(model, &rest, &posed_vertices(model, &rest))
                } else {
                    OrbitCamera::facing(model, &hand.pose, &hand.posed_vertices())
                }
            }
            Subject::Scene { .. } => OrbitCamera::around_unit_sphere(),
        }
    }

    /// Takes over pose, shape and motion of what was shown before, if both are hands with the same joints.
    pub fn continue_from(&mut self, before: &Subject) {
        if let (Subject::Hand(hand), Subject::Hand(before)) = (self, before) {
            hand.continue_from(before);
        }
    }

    /// Its pose, if it has one.
    pub fn pose(&self) -> Option<&Pose> {
        match self {
            Subject::Hand(hand) => Some(&hand.pose),
            Subject::Scene { .. } => None,
        }
    }

    /// The light on it, if light is apart from its colours.
    pub fn light(&self) -> Option<&Light> {
        match self {
            Subject::Hand(hand) => hand.light(),
            Subject::Scene { .. } => None,
        }
    }

    /// Its shape, empty for the mean one.
    pub fn shape(&self) -> &[f64] {
        match self {
            Subject::Hand(hand) => &hand.shape,
            Subject::Scene { .. } => &[],
        }
    }

    /// Advances a motion that plays.
    pub fn advance(&mut self, context: &egui::Context) {
        if let Subject::Hand(hand) = self {
            hand.advance(context);
        }
    }

    /// Stops a motion.
    pub fn pause(&mut self) {
        if let Subject::Hand(hand) = self {
            hand.pause();
        }
    }

    /// Resets its controls.
    pub fn reset(&mut self) {
        if let Subject::Hand(hand) = self {
            hand.reset();
        }
    }

    /// Shows its controls. Returns whether it has any.
    pub fn controls(&mut self, ui: &mut Ui) -> bool {
        match self {
            Subject::Hand(hand) => {
                hand.controls(ui);
                true
            }
            Subject::Scene { .. } => false,
        }
    }
}
