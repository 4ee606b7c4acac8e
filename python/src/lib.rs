//! The compiled half of the Python package `ghand`. `package/ghand/_ghand.pyi` describes it for its users.
//!
//! Whatever takes time runs without the interpreter's lock. Errors become [`error::Error`] with the sentence that the
//! programs print; arguments of a wrong shape or value, `ValueError`.

mod arrays;
mod avatar;
mod camera;
mod device;
mod drawing;
mod error;
mod messages;
mod pose;
mod pose_argument;
mod posed;
mod run;

use pyo3::prelude::*;

/// Real-time, animatable hand avatars from a few camera views.
#[pymodule]
mod _ghand {
    #[pymodule_export]
    use crate::avatar::{Avatar, load};
    #[pymodule_export]
    use crate::camera::{Camera, read_cameras};
    #[pymodule_export]
    use crate::device::close_device;
    #[pymodule_export]
    use crate::error::Error;
    #[pymodule_export]
    use crate::pose::{Pose, Poses, read_poses};
    #[pymodule_export]
    use crate::posed::PosedAvatar;
    #[pymodule_export]
    use crate::run::{Progress, TrainResult, evaluate, train};

    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        messages::listen();
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("POSES", ghand_hand_model::named_poses::POSE_NAMES.to_vec())?;
        module.add("MOTIONS", ghand_motion::motions::MOTION_NAMES.to_vec())
    }
}
