//! Published data sets of hands as captures.
//!
//! [`recognise`] knows a data set by the layout of its folders, and [`write_capture`] writes a capture of one sequence of it:
//! cameras, images, masks where the data set has them, poses, and a split with one frame in five held out. Where the data
//! set has joints in space, the built-in hand is fitted to them. Where it has MANO's parameters, the user's own MANO file
//! ([`Options::hand_model`]) takes them as they are.
//!
//! A file of `layouts` reads one data set into a `Sequence`; `write` makes the capture of it.
//!
//! | data set | what to give | needs MANO's file |
//! |---|---|---|
//! | FreiHAND | its root | no |
//! | HanCo | `rgb/0110` | no |
//! | DexYCB | `20200709-subject-01/20200709_141754` | no |
//! | HO-3D | `train/ABF10` | no |
//! | ContactPose | `full28_use/bowl` | no |
//! | ARCTIC | `images/s01/box_grab_01` | yes |
//! | TACO | `Allocentric_RGB_Videos/TRIPLET/SEQUENCE` | yes |
//! | HOT3D-Clips | `train_aria/clip-000123.tar`, or the folder with its content | yes |

mod dataset;
mod error;
mod fields;
mod layouts;
mod masks;
mod pictures;
mod poses;
mod sequence;
mod warp;
mod write;

pub use dataset::{Dataset, recognise};
pub use error::DatasetError;
pub use write::{OnProgress, Options, Progress, Written, write_capture};
