//! A copy of the subject, for pictures that are made beside the view.

use std::sync::Arc;

use ghand_avatar::ply::SplatScene;
use ghand_avatar::{Avatar, Scene};
use ghand_render::splat::Purpose;
use ghand_render::{Gpu, RenderError};

use crate::bare_hand::BareHand;
use crate::viewer::document::subject::Subject;
use crate::viewer::hand::{Hand, Look};
use crate::viewer::rendering::drawing::Drawing;

/// What can be drawn of a subject.
#[derive(Debug, Clone)]
pub enum SubjectCopy {
    /// An avatar.
    Avatar(Box<Avatar>),
    /// A hand model without an avatar.
    Bare(Arc<BareHand>),
    /// A scene of Gaussians.
    Scene(Box<SplatScene>),
}

impl SubjectCopy {
    /// A copy of a subject.
    pub fn new(subject: &Subject) -> SubjectCopy {
        match subject {
            Subject::Hand(hand) => SubjectCopy::of_hand(hand),
            Subject::Scene { gaussians, .. } => SubjectCopy::Scene(Box::new(gaussians.clone())),
        }
    }

    /// A copy of a hand.
    pub fn of_hand(hand: &Hand) -> SubjectCopy {
        match hand.look() {
            Look::Avatar(avatar) => SubjectCopy::Avatar(avatar.clone()),
            Look::Bare(bare) => SubjectCopy::Bare(bare.clone()),
        }
    }

    /// Uploads it to the device, for frames of at most `max_size` pixels.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold it.
    pub fn on_device(&self, gpu: &Gpu, max_size: [u32; 2]) -> Result<Drawing, RenderError> {
        let scene = match self {
            SubjectCopy::Avatar(avatar) => Scene::new(gpu, &[avatar], Purpose::Images, 1, max_size)?,
            SubjectCopy::Bare(bare) => return Drawing::mesh(gpu, bare.clone()),
            SubjectCopy::Scene(gaussians) => Scene::of_static_gaussians(gpu, gaussians, max_size)?,
        };
        Ok(Drawing::Gaussians(Box::new(scene)))
    }
}
