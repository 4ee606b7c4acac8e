//! What an import does at the moment, for a bar and for stopping it.

/// A step of an import.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Finding the hand in a camera's footage.
    Tracking,
    /// Searching a calibration board in a camera's footage.
    Board,
    /// Cameras and clocks.
    Cameras,
    /// One hand and all its poses.
    Poses,
    /// Writing the images of the chosen frames.
    Images,
    /// Refining hand and poses, and cameras that are not known, by the hand's outlines in them.
    Contours,
}

/// How far an import is.
#[derive(Debug, Clone)]
pub struct Progress {
    /// What it does.
    pub step: Step,
    /// With what: a camera, or empty.
    pub subject: String,
    /// Parts done, and all parts; 0 of 0 where they cannot be counted.
    pub done: usize,
    /// See above.
    pub total: usize,
}

/// Gets told how far it is; returns whether to go on.
pub type OnProgress<'a> = dyn FnMut(&Progress) -> bool + 'a;
