//! A page without any other file: its frame and style, and pictures inside of it.

use std::io::Cursor;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ImageFormat, RgbImage};
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = "
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-weight: 600; } h2 { font-weight: 600; margin-top: 2.5rem; }
table { border-collapse: collapse; } th, td { padding: .3rem .9rem; text-align: right; border-bottom: 1px solid #8884; }
th:first-child, td:first-child { text-align: left; }
pre { background: #8882; padding: .8rem 1rem; overflow-x: auto; border-radius: 6px; }
img, svg { max-width: 100%; height: auto; border-radius: 6px; }
figure { margin: 1.5rem 0; } figcaption { opacity: .75; font-size: .9rem; }
.plots { display: grid; gap: 1rem; } .plots svg { background: white; }
";

/// The page of that title with this body.
pub fn html_page(title: &str, body: &Markup) -> Markup {
    html_page_with("", title, body)
}

/// The same with more styles.
pub fn html_page_with(style: &str, title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body { (body) }
        }
    }
}

/// A picture as an address that contains it.
///
/// # Errors
/// If it cannot be encoded.
pub fn data_url(picture: &RgbImage) -> anyhow::Result<String> {
    let mut bytes = Cursor::new(vec![]);
    picture.write_to(&mut bytes, ImageFormat::Png)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes.into_inner())))
}
