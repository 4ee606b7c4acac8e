//! What the colours of hands show.

use ghand_avatar::Avatar;

/// What the colours of hands show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Layer {
    /// The hand as it was trained, in its light.
    #[default]
    Skin,
    /// The colours of the skin without light.
    Albedo,
    /// How much the training views saw of each place.
    Views,
}

impl Layer {
    /// All in the order in which they are offered.
    pub const ALL: [Layer; 3] = [Layer::Skin, Layer::Albedo, Layer::Views];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Layer::Skin => "skin",
            Layer::Albedo => "albedo",
            Layer::Views => "views",
        }
    }

    /// The layer of that name.
    pub fn of(name: &str) -> Option<Layer> {
        Layer::ALL.into_iter().find(|layer| layer.name() == name)
    }

    /// Whether an avatar can show it.
    pub fn is_of(self, avatar: &Avatar) -> bool {
        match self {
            Layer::Skin => true,
            Layer::Albedo => avatar.light.is_some(),
            Layer::Views => avatar.seen.is_some(),
        }
    }

    /// The avatar in these colours; `None` if it cannot show them.
    pub fn shown(self, avatar: &Avatar) -> Option<Avatar> {
        match self {
            Layer::Skin => Some(avatar.clone()),
            Layer::Albedo => avatar.light.as_ref().map(|_| Avatar { light: None, ..avatar.clone() }),
            Layer::Views => avatar.colored_by_seen(),
        }
    }
}
