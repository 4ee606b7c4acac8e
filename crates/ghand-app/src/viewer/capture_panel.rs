//! The cameras and frames of a capture: the view of each camera, the hand in the pose of each frame.

use std::path::Path;
use std::sync::Arc;

use anyhow::ensure;
use egui::{ComboBox, RichText, Ui};
use ghand_capture::Capture;
use ghand_core::{Camera, HandModel};
use ghand_motion::pose_sequence::{DEFAULT_FPS, ghand::poses_json, read_poses_bytes};
use ghand_motion::{PoseFrame, PoseOptions, PoseSequence};

use crate::capture_args::CaptureOptions;
use crate::viewer::number_slider::number_slider;

/// A capture's cameras, and its poses for the hand that is shown.
#[derive(Debug, Clone)]
pub struct CapturePanel {
    name: String,
    capture: Arc<Capture>,
    frames: Vec<PoseFrame>,
    camera: usize,
    frame: usize,
    /// Remarks of the readers.
    pub remarks: Vec<String>,
}

impl CapturePanel {
    /// Opens a capture for a hand model, which may differ from the capture's own.
    ///
    /// # Errors
    /// One sentence that names the file and the field; also if the poses do not fit the hand model.
    pub fn open(path: &Path, options: &CaptureOptions, model: &HandModel) -> anyhow::Result<CapturePanel> {
        let opened = options.open(path)?;
        let (capture, mut remarks) = (opened.capture, opened.warnings);
        ensure!(!capture.cameras.is_empty() && !capture.frames.is_empty(), "{}: has no views", path.display());
        // Poses of another skeleton are carried over as those of a file are.
        let frame = |frame: &ghand_capture::Frame| PoseFrame {
            id: frame.id.clone(),
            pose: frame.pose.clone(),
            shape: frame.shape.clone(),
        };
        let theirs = PoseSequence {
            fps: DEFAULT_FPS,
            joint_names: capture.hand_model.joint_names.clone(),
            frames: capture.frames.iter().map(frame).collect(),
            warnings: vec![],
        };
        let json = poses_json(&theirs, &capture.hand_model);
        let origin = path.display().to_string();
        let own = read_poses_bytes(&origin, json.as_bytes(), model, &PoseOptions::default())?;
        ensure!(!own.frames.is_empty(), "{origin}: has no poses");
        remarks.extend(own.warnings);
        let name = path.file_name().map_or(origin.clone(), |name| name.to_string_lossy().into_owned());
        Ok(CapturePanel { name, capture: Arc::new(capture), frames: own.frames, camera: 0, frame: 0, remarks })
    }

    /// The chosen camera and frame.
    pub fn chosen(&self) -> Option<(&Camera, &PoseFrame)> {
        Some((self.capture.cameras.get(self.camera)?, self.frames.get(self.frame)?))
    }

    /// The capture.
    pub fn capture(&self) -> &Arc<Capture> {
        &self.capture
    }

    /// Indices of the chosen camera and frame in the capture.
    pub fn chosen_indices(&self) -> Option<(usize, usize)> {
        let (_, frame) = self.chosen()?;
        Some((self.camera, self.capture.frame_index(&frame.id)?))
    }

    /// Goes some cameras forward, or back; the first follows the last.
    pub fn step_camera(&mut self, by: isize) {
        let count = self.capture.cameras.len() as isize;
        self.camera = (self.camera as isize + by).rem_euclid(count.max(1)) as usize;
    }

    /// Shows the controls. Returns whether the user chose a camera or a frame.
    pub fn show(&mut self, ui: &mut Ui) -> bool {
        let mut chosen = false;
        ui.label(RichText::new("Capture").strong());
        ui.label(RichText::new(&self.name).weak());
        ui.horizontal(|ui| {
            let label = ui.label("camera").id;
            if ui.small_button("<").on_hover_text("Previous camera").clicked() {
                self.step_camera(-1);
                chosen = true;
            }
            let text = self.capture.cameras.get(self.camera).map(|camera| camera.id.clone()).unwrap_or_default();
            let list = ComboBox::from_id_salt("camera").selected_text(text).width(100.0).show_ui(ui, |ui| {
                for (k, camera) in self.capture.cameras.iter().enumerate() {
                    chosen |= ui.selectable_value(&mut self.camera, k, &camera.id).clicked();
                }
            });
            list.response.labelled_by(label);
            if ui.small_button(">").on_hover_text("Next camera").clicked() {
                self.step_camera(1);
                chosen = true;
            }
        });
        let last = self.frames.len().saturating_sub(1);
        if last > 0 {
            ui.horizontal(|ui| {
                let label = ui.label("frame").id;
                let mut frame = self.frame as f64;
                ui.spacing_mut().slider_width = 110.0;
                let slider = number_slider(&mut frame, 0.0..=last as f64, 0, "").integer();
                if ui.add(slider).labelled_by(label).changed() {
                    self.frame = (frame as usize).min(last);
                    chosen = true;
                }
            });
        }
        chosen
    }
}
