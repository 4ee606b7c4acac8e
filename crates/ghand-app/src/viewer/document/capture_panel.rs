//! The cameras and frames of a capture: the view of each camera, the hand in the pose of each frame.

use std::path::Path;
use std::sync::Arc;

use anyhow::ensure;
use egui::{ComboBox, RichText, Ui};
use ghand_capture::Capture;
use ghand_core::{Camera, HandModel, Pose};
use ghand_motion::pose_sequence::formats::ghand::poses_json;
use ghand_motion::pose_sequence::{DEFAULT_FPS, read_poses_bytes};
use ghand_motion::{PoseFrame, PoseOptions, PoseSequence};

use crate::capture_source::{CaptureReading, check_sides};
use crate::run_files::CAMERAS_FILE;
use crate::viewer::document::capture_poses::CapturePoses;
use crate::viewer::widgets::number_slider::number_slider;

/// A capture's cameras, and its poses for the hand that is shown.
#[derive(Debug, Clone)]
pub struct CapturePanel {
    name: String,
    capture: Arc<Capture>,
    poses: CapturePoses,
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
    pub fn open(path: &Path, options: &CaptureReading, model: &HandModel) -> anyhow::Result<CapturePanel> {
        let opened = options.open(path)?;
        let capture = opened.capture;
        let mut remarks = opened.warnings;
        ensure!(!capture.cameras.is_empty() && !capture.frames.is_empty(), "{}: has no views", path.display());
        check_sides(&model.name, model.side, &capture)?;
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
        let by_id = PoseOptions { by_id: true, ..Default::default() };
        let origin = path.display().to_string();
        let own = read_poses_bytes(&origin, json.as_bytes(), model, &by_id)?;
        ensure!(!own.frames.is_empty(), "{origin}: has no poses");
        remarks.extend(own.warnings);
        let name = path.file_name().map_or(origin.clone(), |name| name.to_string_lossy().into_owned());
        Ok(CapturePanel {
            name,
            capture: Arc::new(capture),
            poses: CapturePoses::new(own.frames),
            camera: 0,
            frame: 0,
            remarks,
        })
    }

    /// Takes the poses of the training frames, and the cameras if they were refined, from the run that trained this avatar,
    /// if they are beside its file.
    ///
    /// # Errors
    /// One sentence that names the file if it is broken or belongs to another capture; all poses, or the cameras, are as given
    /// then.
    pub fn read_trained_poses(&mut self, avatar: &Path, model: &HandModel) -> anyhow::Result<()> {
        self.poses.read_trained(avatar, &self.capture, model)?;
        let cameras = avatar.with_file_name(CAMERAS_FILE);
        if self.poses.has_trained() && cameras.exists() {
            Arc::make_mut(&mut self.capture).take_cameras(&cameras)?;
        }
        Ok(())
    }

    /// The poses of the frames.
    pub fn poses(&self) -> &CapturePoses {
        &self.poses
    }

    /// Shows the poses of training where there are any, or all as given.
    pub fn choose_poses(&mut self, of_training: bool) {
        self.poses.choose(of_training);
    }

    /// The chosen camera, and the pose of the chosen frame.
    pub fn chosen(&self) -> Option<(&Camera, &Pose)> {
        Some((self.capture.cameras.get(self.camera)?, self.poses.pose(self.frame)?))
    }

    /// The capture.
    pub fn capture(&self) -> &Arc<Capture> {
        &self.capture
    }

    /// Indices of the chosen camera and frame in the capture.
    pub fn chosen_indices(&self) -> Option<(usize, usize)> {
        self.capture.cameras.get(self.camera)?;
        Some((self.camera, self.capture.frame_index(self.poses.id(self.frame)?)?))
    }

    /// Goes some cameras forward, or back; the first follows the last.
    pub fn step_camera(&mut self, by: isize) {
        let count = self.capture.cameras.len() as isize;
        self.camera = (self.camera as isize + by).rem_euclid(count.max(1)) as usize;
    }

    /// Shows the controls. Returns whether the user chose a camera, a frame or its pose.
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
        let last = self.poses.len().saturating_sub(1);
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
        chosen | self.show_poses(ui)
    }

    /// The choice between the poses, if there is one.
    fn show_poses(&mut self, ui: &mut Ui) -> bool {
        if !self.poses.has_trained() {
            return false;
        }
        let before = self.poses.are_of_training();
        let mut of_training = before;
        ui.horizontal(|ui| {
            ui.label("poses");
            let hover =
                "Poses of the training frames as the training of this avatar refined them; others are as given.";
            ui.selectable_value(&mut of_training, true, "of training").on_hover_text(hover);
            ui.selectable_value(&mut of_training, false, "as given").on_hover_text("Poses as in the capture's files.");
        });
        self.poses.choose(of_training);
        ui.label(RichText::new(self.poses.remark(self.frame)).weak());
        of_training != before
    }
}
