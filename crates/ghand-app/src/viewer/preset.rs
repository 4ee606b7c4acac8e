//! The sides from which a hand is seen.

/// A side of a hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
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

impl Preset {
    /// All in the order in which they are offered.
    pub const ALL: [Preset; 5] =
        [Preset::Back, Preset::Palm, Preset::ThumbSide, Preset::LittleFingerSide, Preset::Fingertips];

    /// Its name for `--view`.
    pub const fn name(self) -> &'static str {
        match self {
            Preset::Back => "back",
            Preset::Palm => "palm",
            Preset::ThumbSide => "thumb-side",
            Preset::LittleFingerSide => "little-finger-side",
            Preset::Fingertips => "fingertips",
        }
    }

    /// Its name on the narrow panel.
    pub const fn label(self) -> &'static str {
        match self {
            Preset::Back => "back",
            Preset::Palm => "palm",
            Preset::ThumbSide => "thumb side",
            Preset::LittleFingerSide => "little side",
            Preset::Fingertips => "tips",
        }
    }

    /// The side of that name.
    pub fn of(name: &str) -> Option<Preset> {
        Preset::ALL.into_iter().find(|preset| preset.name() == name)
    }
}
