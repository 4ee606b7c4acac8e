//! How well the hand that was fitted to landmarks fits them: by joint, by frame, by camera.

use std::fmt;

use ghand_core::{Camera, HandModel};
use serde_json::{Map, Value as Json, json};

use crate::ik::person::proportions::Proportions;
use crate::ik::person::sightings::{SeenFrame, SightingPosition};
use crate::ik::person::{FittedFrame, PersonFit};
use crate::ik::{BONES, LANDMARK_COUNT};

/// Adults' hands differ in length by 5 to 6 % (one standard deviation; Pheasant, Bodyspace, 1996): one that differs by
/// more than three of them from the model's, whose mean is that of adults, is a child's or has a wrong scale.
const USUAL_SIZE: f64 = 0.17;
/// Most frames that a report lists.
const LISTED_FRAMES: usize = 8;

/// Names of the landmarks, in order.
const LANDMARK_NAMES: [&str; LANDMARK_COUNT] = [
    "wrist",
    "thumb base",
    "thumb knuckle",
    "thumb hinge",
    "thumb tip",
    "index knuckle",
    "index hinge 1",
    "index hinge 2",
    "index tip",
    "middle knuckle",
    "middle hinge 1",
    "middle hinge 2",
    "middle tip",
    "ring knuckle",
    "ring hinge 1",
    "ring hinge 2",
    "ring tip",
    "little knuckle",
    "little hinge 1",
    "little hinge 2",
    "little tip",
];

/// A hand that was fitted to landmarks: its shape, and how far the landmarks are from it.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkFit {
    /// Unit of all distances from landmarks: `mm`, or `px` of the images without distortion.
    pub unit: &'static str,
    /// The shape parameters that were found, by name or number; empty if the model has none that change lengths.
    pub shape: Vec<(String, f64)>,
    /// From the wrist over the joints of the middle finger to its tip, of the model as it is and of the person, metres.
    pub lengths: [f64; 2],
    /// The landmarks, in MediaPipe's order.
    pub landmarks: Vec<LandmarkResidual>,
    /// The cameras; empty for landmarks in space.
    pub cameras: Vec<(String, Distances)>,
    /// The frames that have a pose.
    pub frames: Vec<FrameResidual>,
    /// The frames without a pose, and why.
    pub rejected: Vec<(String, String)>,
    /// What the user should know, one sentence each.
    pub remarks: Vec<String>,
}

/// Distances of landmarks from the fitted hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distances {
    /// Median.
    pub median: f64,
    /// Nine of ten are below.
    pub ninth: f64,
    /// How many there are.
    pub count: usize,
    /// How many of them are wrong: so far off that they hardly count.
    pub wrong: usize,
}

/// One landmark over all frames.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkResidual {
    /// Its name.
    pub name: &'static str,
    /// How far it is from the fitted hand; none if no frame has it.
    pub distances: Option<Distances>,
    /// Length of the bone that it ends, as a multiple of the model's in the fitted shape; 1 for the wrist.
    pub bone: f64,
}

/// One frame over all landmarks.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameResidual {
    /// Its id.
    pub id: String,
    /// How far its landmarks are from the fitted hand.
    pub distances: Distances,
    /// The landmarks that are wrong, with their cameras, as text.
    pub wrong: Vec<String>,
}

/// How far one landmark, seen once, is from the fitted hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SightingDistance {
    /// Number of the landmark.
    pub landmark: usize,
    /// Number of the camera; `None` for a landmark in space.
    pub camera: Option<usize>,
    /// Pixels of the image without distortion, or millimetres of a landmark in space.
    pub distance: f64,
    /// Whether it is so far off that it hardly counts.
    pub is_wrong: bool,
}

/// A frame with its hand.
pub(crate) struct KeptFrame<'a> {
    seen: &'a SeenFrame,
    found: &'a FittedFrame,
    cameras: &'a [Camera],
    /// Landmarks further off are wrong, metres.
    limit: f64,
}

impl<'a> KeptFrame<'a> {
    pub fn new(seen: &'a SeenFrame, found: &'a FittedFrame, cameras: &'a [Camera], limit: f64) -> KeptFrame<'a> {
        KeptFrame { seen, found, cameras, limit }
    }

    /// In the report's unit.
    pub fn distances(&self) -> impl Iterator<Item = SightingDistance> {
        self.seen.sightings.iter().zip(&self.found.distances).filter_map(|(sighting, metres)| {
            let (camera, distance) = match sighting.place {
                SightingPosition::Point(_) => (None, metres * 1000.0),
                SightingPosition::Pixel(camera, _) => {
                    (Some(camera), metres / self.found.scales.get(camera).unwrap_or(&f64::NAN))
                }
                // Nobody saw it there.
                SightingPosition::Guess(_) => return None,
            };
            Some(SightingDistance { landmark: sighting.landmark, camera, distance, is_wrong: *metres > self.limit })
        })
    }

    pub fn wrong_count(&self) -> usize {
        self.distances().filter(|sighting| sighting.is_wrong).count()
    }

    /// Why the frame has no pose.
    pub fn cause(&self) -> String {
        let numbers: Vec<Option<usize>> = match self.cameras {
            [] => vec![None],
            cameras => (0..cameras.len()).map(Some).collect(),
        };
        let of_camera = |number: Option<usize>| {
            let (count, wrong) = self
                .distances()
                .filter(|sighting| sighting.camera == number)
                .fold((0, 0), |(count, wrong), sighting| (count + 1, wrong + usize::from(sighting.is_wrong)));
            let of = number.and_then(|k| self.cameras.get(k)).map_or("the".into(), |camera| format!("{}'s", camera.id));
            (wrong > 0).then(|| format!("{wrong} of {of} {count} landmarks"))
        };
        let parts: Vec<String> = numbers.into_iter().filter_map(of_camera).collect();
        let limit = self.limit * 1000.0;
        format!("{} are more than {limit:.0} mm from the hand that the other frames show", parts.join(" and "))
    }

    fn residual(&self) -> FrameResidual {
        let wrong = self.distances().filter(|sighting| sighting.is_wrong).map(|sighting| {
            let name = LANDMARK_NAMES[sighting.landmark];
            let camera = sighting.camera.and_then(|k| self.cameras.get(k));
            camera.map_or(name.to_owned(), |camera| format!("{name} in {}", camera.id))
        });
        FrameResidual {
            id: self.seen.id.clone(),
            wrong: wrong.collect(),
            // A kept frame has landmarks.
            distances: summary(self.distances()).unwrap_or(Distances::NONE),
        }
    }
}

impl Distances {
    const NONE: Distances = Distances { median: f64::NAN, ninth: f64::NAN, count: 0, wrong: 0 };

    fn to_json(self) -> Json {
        json!({"median": self.median, "ninth_of_ten": self.ninth, "count": self.count, "wrong": self.wrong})
    }
}

fn summary(distances: impl Iterator<Item = SightingDistance>) -> Option<Distances> {
    let all: Vec<SightingDistance> = distances.collect();
    let mut values: Vec<f64> = all.iter().map(|sighting| sighting.distance).collect();
    values.sort_by(f64::total_cmp);
    let at =
        |part: f64| values.get(((values.len() as f64 * part) as usize).min(values.len().saturating_sub(1))).copied();
    let wrong = all.iter().filter(|sighting| sighting.is_wrong).count();
    Some(Distances { median: at(0.5)?, ninth: at(0.9)?, count: values.len(), wrong })
}

/// The report of a fit.
pub(crate) fn report(
    model: &HandModel,
    proportions: &Proportions,
    fit: &PersonFit,
    kept: &[KeptFrame],
    cameras: &[Camera],
    rejected: Vec<(String, String)>,
) -> LandmarkFit {
    let all: Vec<SightingDistance> = kept.iter().flat_map(KeptFrame::distances).collect();
    let [own, shaped, person] =
        [vec![0.0; proportions.count()], proportions.without_bones(&fit.parameters), fit.parameters.clone()]
            .map(|parameters| proportions.hand(&parameters));
    let [model_lengths, shaped_lengths, lengths] = [&own, &shaped, &person].map(|hand| proportions.lengths(hand));
    let landmark = |k: usize| {
        let bone = BONES.iter().position(|(_, to)| *to == k).map_or(1.0, |bone| lengths[bone] / shaped_lengths[bone]);
        let distances = all.iter().filter(|sighting| sighting.landmark == k).copied();
        LandmarkResidual { name: LANDMARK_NAMES[k], distances: summary(distances), bone }
    };
    let camera = |(number, camera): (usize, &Camera)| {
        let distances = all.iter().filter(|sighting| sighting.camera == Some(number)).copied();
        Some((camera.id.clone(), summary(distances)?))
    };
    let shape = proportions.shape(&fit.parameters);
    let name = |k: usize| model.shape_names.get(k).cloned().unwrap_or_else(|| k.to_string());
    let lengths = [middle_finger(&model_lengths), middle_finger(&lengths)];
    let cameras: Vec<(String, Distances)> = cameras.iter().enumerate().filter_map(camera).collect();
    let mut remarks = vec![];
    let ratio = lengths[1] / lengths[0];
    if cameras.len() == 1 {
        remarks.push(
            "one camera sees how large the hand is only from its distance, and the distance only from its size: both rest \
             on the model's mean size, and people's differ by 5 to 6 %; a second calibrated camera would tell"
                .into(),
        );
    } else if (ratio - 1.0).abs() > USUAL_SIZE {
        let percent = 100.0 * (ratio - 1.0).abs();
        let than = if ratio < 1.0 { "shorter" } else { "longer" };
        remarks.push(format!(
            "the hand is {percent:.0} % {than} than the model's, more than adults differ: check the scale of the \
             {}",
            if cameras.is_empty() { "landmarks, which must be in metres" } else { "cameras' translations, in metres" }
        ));
    }
    LandmarkFit {
        unit: if cameras.is_empty() { "mm" } else { "px" },
        shape: shape
            .iter()
            .enumerate()
            .filter(|(_, value)| **value != 0.0)
            .map(|(k, value)| (name(k), *value))
            .collect(),
        lengths,
        landmarks: (0..LANDMARK_COUNT).map(landmark).collect(),
        cameras,
        frames: kept.iter().map(KeptFrame::residual).collect(),
        rejected,
        remarks,
    }
}

/// The sum of the bones from the wrist to the middle finger's tip.
fn middle_finger(lengths: &[f64; BONES.len()]) -> f64 {
    BONES.iter().zip(lengths).filter(|((_, to), _)| (9..=12).contains(to)).map(|(_, length)| length).sum()
}

impl LandmarkFit {
    /// As part of a file of poses.
    pub fn to_json(&self) -> Json {
        let shape: Map<String, Json> = self.shape.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
        let landmark = |residual: &LandmarkResidual| {
            let distances = residual.distances.map_or(Json::Null, Distances::to_json);
            json!({"name": residual.name, "distances": distances, "bone": residual.bone})
        };
        let frame = |frame: &FrameResidual| json!({"id": frame.id, "distances": frame.distances.to_json(), "wrong": frame.wrong});
        let cameras: Map<String, Json> = self.cameras.iter().map(|(id, d)| (id.clone(), d.to_json())).collect();
        let rejected: Map<String, Json> = self.rejected.iter().map(|(id, cause)| (id.clone(), json!(cause))).collect();
        json!({
            "unit": self.unit,
            "shape": shape,
            "model_length": self.lengths[0],
            "length": self.lengths[1],
            "landmarks": self.landmarks.iter().map(landmark).collect::<Vec<_>>(),
            "cameras": cameras,
            "frames": self.frames.iter().map(frame).collect::<Vec<_>>(),
            "rejected": rejected,
            "remarks": self.remarks,
        })
    }
}

/// A short table, for a terminal.
impl fmt::Display for LandmarkFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [model, person] = self.lengths.map(|length| length * 1000.0);
        writeln!(
            f,
            "hand: {person:.0} mm from the wrist along the middle finger to its landmark at the tip, the model's {model:.0} mm"
        )?;
        if !self.shape.is_empty() {
            let shape: Vec<String> = self.shape.iter().map(|(name, value)| format!("{name} {value:.2}")).collect();
            writeln!(f, "shape: {}", shape.join(", "))?;
        }
        let unit = self.unit;
        writeln!(
            f,
            "{:<16}{:>8}{:>9}{:>8}   bone beyond the shape",
            "landmark",
            format!("median"),
            "9 of 10",
            "wrong"
        )?;
        for landmark in &self.landmarks {
            let Some(Distances { median, ninth, count, wrong }) = landmark.distances else { continue };
            let wrong = 100.0 * wrong as f64 / count.max(1) as f64;
            let bone = 100.0 * (landmark.bone - 1.0);
            let bone = if landmark.name == "wrist" { String::new() } else { format!("{bone:+.0} %") };
            writeln!(f, "{:<16}{median:>5.1} {unit}{ninth:>6.1} {unit}{wrong:>6.0} %   {bone}", landmark.name)?;
        }
        for (id, Distances { median, ninth, count, wrong }) in &self.cameras {
            let wrong = 100.0 * *wrong as f64 / (*count).max(1) as f64;
            writeln!(f, "{id:<16}{median:>5.1} {unit}{ninth:>6.1} {unit}{wrong:>6.0} %")?;
        }
        let mut worst: Vec<&FrameResidual> = self.frames.iter().filter(|frame| !frame.wrong.is_empty()).collect();
        worst.sort_by_key(|frame| std::cmp::Reverse(frame.wrong.len()));
        if !worst.is_empty() {
            writeln!(f, "frames with wrong landmarks: {}, the worst:", worst.len())?;
        }
        for frame in worst.iter().take(LISTED_FRAMES) {
            writeln!(
                f,
                "  {}: {} of {}: {}",
                frame.id,
                frame.wrong.len(),
                frame.distances.count,
                listed(&frame.wrong)
            )?;
        }
        if !self.rejected.is_empty() {
            writeln!(f, "frames without a pose: {}", self.rejected.len())?;
        }
        for (id, cause) in self.rejected.iter().take(LISTED_FRAMES) {
            writeln!(f, "  {id}: {cause}")?;
        }
        self.remarks.iter().try_for_each(|remark| writeln!(f, "{remark}"))
    }
}

fn listed(names: &[String]) -> String {
    const MOST: usize = 4;
    let more = if names.len() > MOST { ", ..." } else { "" };
    format!("{}{more}", names.iter().take(MOST).map(String::as_str).collect::<Vec<_>>().join(", "))
}
