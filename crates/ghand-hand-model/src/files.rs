//! Files of hand models: readers of any rigged hand, and writers of posed and of rigged ones.

pub(crate) mod export;
pub mod glb;
pub mod glb_document;
pub mod gltf;
pub mod mano;
pub mod obj;
pub mod read;
pub mod rigged_glb;
