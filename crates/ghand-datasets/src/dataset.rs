//! Which data set a folder is of.

use std::path::Path;

use ghand_core::Side;

use crate::DatasetError;
use crate::layouts::{arctic, contactpose, dexycb, freihand, hanco, ho3d, hot3d, taco};
use crate::sequence::Sequence;

/// A published data set of hands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dataset {
    /// FreiHAND: single images of many hands.
    FreiHand,
    /// HanCo: FreiHAND's recordings, 8 cameras.
    HanCo,
    /// DexYCB: hands that grasp objects, 8 cameras.
    DexYcb,
    /// HO-3D: hands with objects, up to 5 cameras.
    Ho3d,
    /// ContactPose: hands that hold an object still, 3 cameras.
    ContactPose,
    /// ARCTIC: two hands with an object, 8 cameras.
    Arctic,
    /// TACO: two hands with tools, 12 cameras.
    Taco,
    /// HOT3D-Clips: two hands seen from a headset.
    Hot3d,
}

impl Dataset {
    const ALL: [Dataset; 8] = [
        Dataset::FreiHand,
        Dataset::HanCo,
        Dataset::DexYcb,
        Dataset::Ho3d,
        Dataset::ContactPose,
        Dataset::Arctic,
        Dataset::Taco,
        Dataset::Hot3d,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        self.layout().name
    }

    pub(crate) fn layout(self) -> Layout {
        match self {
            Dataset::FreiHand => freihand::LAYOUT,
            Dataset::HanCo => hanco::LAYOUT,
            Dataset::DexYcb => dexycb::LAYOUT,
            Dataset::Ho3d => ho3d::LAYOUT,
            Dataset::ContactPose => contactpose::LAYOUT,
            Dataset::Arctic => arctic::LAYOUT,
            Dataset::Taco => taco::LAYOUT,
            Dataset::Hot3d => hot3d::LAYOUT,
        }
    }
}

/// How a data set is recognised and read.
pub(crate) struct Layout {
    pub name: &'static str,
    /// What to give, relative to the root.
    pub example: &'static str,
    /// Whether a path is one sequence.
    pub is_sequence: fn(&Path) -> bool,
    /// Whether a folder is the whole data set, or has several sequences of it.
    pub is_whole: fn(&Path) -> bool,
    pub read: fn(&Path, Option<Side>) -> Result<Sequence, DatasetError>,
}

/// The data set that a folder, or a clip of HOT3D, is of; `None` if it is of none that is known. Only names are looked at.
pub fn recognise(folder: &Path) -> Option<Dataset> {
    let is =
        |is: fn(Layout) -> fn(&Path) -> bool| Dataset::ALL.into_iter().find(|dataset| is(dataset.layout())(folder));
    is(|layout| layout.is_sequence).or_else(|| is(|layout| layout.is_whole))
}

/// Reads the sequence in a folder.
pub(crate) fn read(folder: &Path, side: Option<Side>) -> Result<(Dataset, Sequence), DatasetError> {
    if !folder.exists() {
        return Err(DatasetError::file(folder, "does not exist; give the folder of a sequence"));
    }
    let dataset = recognise(folder).ok_or_else(|| DatasetError::Unknown(folder.into()))?;
    let layout = dataset.layout();
    if !(layout.is_sequence)(folder) {
        let problem = format!("has many sequences of {}; give one of them, such as {}", layout.name, layout.example);
        return Err(DatasetError::file(folder, problem));
    }
    let sequence = (layout.read)(folder, side)?;
    if sequence.frames.is_empty() {
        let problem = "has no frame with an image in which the hand is annotated; choose another sequence, or unpack all of \
                       the data set's files";
        return Err(DatasetError::file(folder, problem));
    }
    Ok((dataset, sequence))
}
