//! What is drawn of a subject, without its pose and its controls: enough for pictures beside the view.

use std::sync::Arc;

use ghand_avatar::scene_files::SplatScene;
use ghand_avatar::{Avatar, Scene};
use ghand_render::splat::Purpose;
use ghand_render::{Gpu, RenderError};

use crate::bare_hand::BareHand;
use crate::viewer::rendering::drawing::Drawing;

/// What can be drawn of a subject.
#[derive(Debug, Clone)]
pub enum DrawnSubject {
    /// An avatar.
    Avatar(Arc<Avatar>),
    /// A hand model without an avatar.
    Bare(Arc<BareHand>),
    /// A scene of Gaussians.
    Scene(Arc<SplatScene>),
}

impl DrawnSubject {
    /// Uploads it to the device, for frames of at most `max_size` pixels.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold it.
    pub fn on_device(&self, gpu: &Gpu, max_size: [u32; 2]) -> Result<Drawing, RenderError> {
        let scene = match self {
            DrawnSubject::Avatar(avatar) => Scene::new(gpu, &[avatar], Purpose::Images, 1, max_size)?,
            DrawnSubject::Bare(bare) => return Drawing::mesh(gpu, bare.clone()),
            DrawnSubject::Scene(gaussians) => Scene::of_static_gaussians(gpu, gaussians, max_size)?,
        };
        Ok(Drawing::Gaussians(Box::new(scene)))
    }
}
