//! Plays avatars in web pages: what the page's element `<ghand-avatar>` calls.
//!
//! [`stage`] has what is shown, without a device: hands with their poses and motions, the view, the light. `player` draws
//! it on a canvas with WebGPU; it exists for `wasm32-unknown-unknown` only. The element itself and its controls are in
//! `web/`; `make web` builds both into `web/dist/`.

pub mod description;
pub mod hand;
pub mod layer;
#[cfg(target_arch = "wasm32")]
mod player;
pub mod stage;
