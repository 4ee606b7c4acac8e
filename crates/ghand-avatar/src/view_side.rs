//! The sides from which a hand is seen.

/// A side of a hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewSide {
    /// The back of the hand.
    Back,
    /// The palm.
    Palm,
    /// The thumb's side.
    ThumbSide,
    /// The little finger's side.
    LittleFingerSide,
    /// The fingertips, from beyond them.
    Fingertips,
}

impl ViewSide {
    /// All in the order in which they are offered.
    pub const ALL: [ViewSide; 5] =
        [ViewSide::Back, ViewSide::Palm, ViewSide::ThumbSide, ViewSide::LittleFingerSide, ViewSide::Fingertips];

    /// Its name for `--view`.
    pub const fn name(self) -> &'static str {
        match self {
            ViewSide::Back => "back",
            ViewSide::Palm => "palm",
            ViewSide::ThumbSide => "thumb-side",
            ViewSide::LittleFingerSide => "little-finger-side",
            ViewSide::Fingertips => "fingertips",
        }
    }

    /// Its name on the narrow panel.
    pub const fn label(self) -> &'static str {
        match self {
            ViewSide::Back => "back",
            ViewSide::Palm => "palm",
            ViewSide::ThumbSide => "thumb side",
            ViewSide::LittleFingerSide => "little side",
            ViewSide::Fingertips => "tips",
        }
    }

    /// The side of that name.
    pub fn of(name: &str) -> Option<ViewSide> {
        ViewSide::ALL.into_iter().find(|side| side.name() == name)
    }
}
