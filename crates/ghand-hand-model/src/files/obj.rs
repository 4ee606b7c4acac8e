//! Wavefront OBJ: a UV atlas for a model whose own file has none, and posed meshes for other programs.

mod read;
mod write;

pub use read::{UvLayout, read_obj_uvs};
pub use write::{obj_text, write_obj};

#[cfg(test)]
mod tests;
