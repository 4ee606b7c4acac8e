//! Pages with the player for avatars, as a file of its own or for a server. The player in `web/dist/` is built by
//! `make web`.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use maud::{DOCTYPE, PreEscaped, html};

/// The player's script, an ES module.
pub const SCRIPT: &str = include_str!("../../../web/dist/ghand-avatar.js");
/// The player's WebAssembly.
pub const WASM: &[u8] = include_bytes!("../../../web/dist/ghand.wasm");

/// Colour behind the hand, display values, as in the style.
pub const BACKGROUND: [f32; 3] = [232.0 / 255.0, 235.0 / 255.0, 238.0 / 255.0];
const STYLE: &str = "html, body { height: 100%; margin: 0; }
body { background: rgb(232 235 238); }
ghand-avatar { height: 100%; }";

/// Where a page finds something.
#[derive(Debug, Clone)]
pub enum Source {
    /// At an address.
    At(String),
    /// In the page.
    Inside {
        /// Its media type.
        kind: &'static str,
        /// Its bytes.
        bytes: Vec<u8>,
    },
}

impl Source {
    fn url(&self) -> String {
        match self {
            Source::At(url) => url.clone(),
            Source::Inside { kind, bytes } => format!("data:{kind};base64,{}", STANDARD.encode(bytes)),
        }
    }
}

/// What a page shows.
#[derive(Debug, Clone, Default)]
pub struct PlayerPage {
    /// Its title.
    pub title: String,
    /// The avatars, in one scene.
    pub avatars: Vec<Source>,
    /// The pose by name at first.
    pub pose: Option<String>,
    /// The motion that is played, by name or as a file of poses.
    pub motion: Option<Source>,
    /// A picture where there is no WebGPU.
    pub poster: Option<Source>,
}

/// Bytes in a third of the space, by gzip.
fn zipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    // A list in memory takes all bytes.
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}

impl PlayerPage {
    /// The page with the player beside it, as `ghand-avatar.js` and `ghand.wasm`.
    pub fn beside_player(&self) -> String {
        self.html(&html! { script type="module" src="ghand-avatar.js" {} })
    }

    /// The page with the player inside: it needs no other file.
    pub fn self_contained(&self) -> String {
        let wasm = Source::Inside { kind: "application/gzip", bytes: zipped(WASM) }.url();
        let unzipped = "(zipped) => new Response(zipped.body.pipeThrough(new DecompressionStream(\"gzip\")), \
                        { headers: { \"Content-Type\": \"application/wasm\" } })";
        // A script ends at its end tag, also within a string.
        let script = SCRIPT.replace("</script", "<\\/script");
        self.html(&html! {
            script { (PreEscaped(format!("globalThis.ghandWasm = fetch(\"{wasm}\").then({unzipped});"))) }
            script type="module" { (PreEscaped(script)) }
        })
    }

    fn html(&self, player: &PreEscaped<String>) -> String {
        let sources: Vec<String> = self.avatars.iter().map(Source::url).collect();
        let motion = self.motion.as_ref().map(Source::url);
        let poster = self.poster.as_ref().map(Source::url);
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.title) }
                    link rel="icon" href="data:,";
                    style { (PreEscaped(STYLE)) }
                    (player)
                }
                body {
                    ghand-avatar src=(sources.join(" ")) pose=[&self.pose] motion=[motion] poster=[poster] controls {}
                }
            }
        }
        .into_string()
    }
}
