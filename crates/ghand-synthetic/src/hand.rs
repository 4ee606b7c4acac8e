//! The true hand: a random person's shape, its finer mesh, and how it moves.

pub(crate) mod anatomy;
pub(crate) mod finger_play;
pub(crate) mod forearm;
pub(crate) mod random_bones;
pub(crate) mod random_shape;
pub(crate) mod skinning;
pub(crate) mod subdivision;
pub mod trajectory;
pub(crate) mod true_hand;
