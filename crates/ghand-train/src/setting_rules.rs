//! Allowed values of each training setting, and their description in messages.

use serde_json::Value;

/// The allowed values of a setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rule {
    /// Whole numbers between two bounds, both included.
    Whole(u64, u64),
    /// The same, or 0.
    ZeroOr(u64, u64),
    /// Numbers between two bounds, both included.
    Number(f64, f64),
    /// Numbers above 0, up to 1.
    AboveZero,
    /// One of these words.
    Word(&'static [&'static str]),
}

/// Larger numbers would be infinite as f32 on the device.
const LARGEST: f64 = 1e38;
/// A run of this many iterations takes years.
const MOST_ITERATIONS: u64 = 1_000_000_000;
/// 2^53: up to here an f64 represents every whole number exactly.
const LARGEST_EXACT: f64 = 9_007_199_254_740_992.0;

/// The rule of a setting; `None` if no setting has this name.
pub(crate) fn rule(name: &str) -> Option<Rule> {
    Some(match name {
        "iterations" => Rule::Whole(1, MOST_ITERATIONS),
        "model" => Rule::Word(&["direct", "network"]),
        "components" => Rule::Word(&["baseline", "hgbs", "full"]),
        "simplify" => Rule::Word(&["off", "auto"]),
        "images_per_step" => Rule::Whole(1, 64),
        "network" => Rule::Word(&["quick", "paper"]),
        "align" => Rule::Word(&["contours", "paper", "off"]),
        "light" => Rule::Word(&["auto", "transfer", "off"]),
        "gaussians" => Rule::Word(&["round", "flat"]),
        "gloss" => Rule::Word(&["auto", "always", "off"]),
        "exposure" => Rule::Word(&["auto", "per_camera", "off"]),
        "unseen" => Rule::Word(&["fill", "off"]),
        "uv_resolution" => Rule::ZeroOr(8, 2048),
        "seed" => Rule::Whole(0, u64::MAX),
        "shape_bases" => Rule::Whole(1, 32),
        "color_components" => Rule::Whole(0, 32),
        "final_rate" => Rule::AboveZero,
        "coefficients" => Rule::Word(&["per_basis", "per_component"]),
        "residual_weights" => Rule::Word(&["paper", "zero_sum"]),
        "residual_skeleton" => Rule::Word(&["paper", "anchored"]),
        "antialias" => Rule::Word(&["on", "off"]),
        "max_seconds" | "lpips_weight" | "merge_below" | "color_roughness" => Rule::Number(0.0, LARGEST),
        name if name.starts_with("rate_") => Rule::Number(0.0, LARGEST),
        _ => return None,
    })
}

/// Settings that were removed in 0.2: name, the default that they had, and why they were removed.
const REMOVED: [(&str, &str, &str); 24] = [
    ("refine", "off", "it made the avatar of one capture better and of another worse, 0.03 dB better in the mean"),
    ("rate_light", "0.01", "training the light on brought less than 0.1 dB on every capture"),
    ("coverage_weight", "0.0", "it changed PSNR by less than 0.1 dB"),
    ("offset_roughness", "300.0", "it is always 300, which suits all captures that were measured"),
    ("offset_weight", "10.0", "it is always 10, as in the paper"),
    ("scale_weight", "1.0", "it is always 1 in stage 1, as in the paper"),
    ("frame_gain", "same", "no measurement shows that it pays"),
    ("residual_support", "all", "weights of the joints nearby alone had 32.00 dB, those of all 32.09"),
    ("pose_stage", "0.62", "stage 1 has a third of the iterations with model=network, as in the paper, else 0.62"),
    (
        "pose_prior_rounds",
        "3",
        "stage 1 draws the poses towards their prior three times, with model=network never, as in the paper",
    ),
    ("pose_uv_resolution", "96", "stage 1 has the uv_resolution of the run, without model=network at most 96"),
    (
        "pose_image_reduction",
        "2",
        "stage 1 has images of half the size, with model=network of the whole, as in the paper",
    ),
    ("rate_pose", "0.01", "it is always 0.01, and 0.005 with model=network, as in the paper"),
    ("rate_translation", "0.001", "it is always 0.001"),
    ("start_inset", "1.0", "it is always 1, which suits flat Gaussians"),
    ("crop_margin", "16", "it is always 16"),
    ("l1_weight", "0.8", "it is always 0.8, as in the paper"),
    ("ssim_weight", "0.2", "it is always 0.2, as in the paper"),
    ("rate_regressor", "1e-6", "it is always 1e-6"),
    ("rate_scale", "0.01", "it is always 0.01"),
    ("rate_color", "0.02", "it is always 0.02"),
    ("rate_components", "0.005", "it is always 0.005"),
    ("rate_response", "0.005", "it is always 0.005"),
    ("gradient_clip", "10.0", "it is always 10"),
];

/// The message for a `key` that was a setting once.
pub(crate) fn removed(key: &str) -> Option<String> {
    let (.., reason) = REMOVED.iter().find(|(name, ..)| *name == key)?;
    Some(format!("was removed in 0.2: {reason}; leave it out"))
}

/// Whether a file of an earlier version gives a setting that was removed the default that it had.
pub(crate) fn is_removed_default(key: &str, text: &str) -> bool {
    let is_default = |default: &str| text == default || text.parse::<f64>().is_ok_and(|v| default.parse() == Ok(v));
    REMOVED.iter().any(|(name, default, _)| *name == key && is_default(default))
}

/// What was `off` before 0.2.
const FORMER_OFF: [(&str, &str); 5] =
    [("align", "none"), ("light", "none"), ("gloss", "none"), ("exposure", "same"), ("unseen", "keep")];

/// Whether a setting's value in a file of an earlier version means `off`.
pub(crate) fn is_former_off(key: &str, text: &str) -> bool {
    FORMER_OFF.contains(&(key, text))
}

impl Rule {
    /// Reads a value; `None` if it has the wrong type or is out of range.
    pub fn parse(self, text: &str) -> Option<Value> {
        let value = match self {
            Rule::Whole(..) | Rule::ZeroOr(..) => Value::from(whole(text)?),
            Rule::Number(..) | Rule::AboveZero => Value::from(text.parse::<f64>().ok()?),
            Rule::Word(_) => Value::from(text),
        };
        self.allows(&value).then_some(value)
    }

    /// Whether a value has the right type and is in range.
    pub fn allows(self, value: &Value) -> bool {
        match self {
            Rule::Whole(least, most) => value.as_u64().is_some_and(|v| (least..=most).contains(&v)),
            Rule::ZeroOr(least, most) => value.as_u64().is_some_and(|v| v == 0 || (least..=most).contains(&v)),
            Rule::Number(least, most) => value.as_f64().is_some_and(|v| (least..=most).contains(&v)),
            Rule::AboveZero => value.as_f64().is_some_and(|v| v > 0.0 && v <= 1.0),
            Rule::Word(words) => value.as_str().is_some_and(|v| words.contains(&v)),
        }
    }

    /// "must be ...", with an example such as `iterations=3000`.
    pub fn wanted(self, example: &str) -> String {
        let range = match self {
            Rule::Whole(least, u64::MAX) => format!("a whole number, at least {least}"),
            Rule::Whole(least, most) => format!("a whole number, from {least} to {most}"),
            Rule::ZeroOr(least, most) => format!("0 or a whole number, from {least} to {most}"),
            Rule::Number(least, most) => format!("a number, from {least} to {most:e}"),
            Rule::AboveZero => "a number, above 0 and at most 1".into(),
            Rule::Word(words) => words.iter().map(|w| format!("`{w}`")).collect::<Vec<_>>().join(" or "),
        };
        format!("must be {range}, as in {example}")
    }
}

/// A whole number, also as `1e3` or `1000.0`.
fn whole(text: &str) -> Option<u64> {
    text.parse().ok().or_else(|| {
        let number: f64 = text.parse().ok()?;
        ((0.0..=LARGEST_EXACT).contains(&number) && number.fract() == 0.0).then_some(number as u64)
    })
}

/// Similarity of two names, from 0 to 1, above which one counts as a misspelling of the other.
const MIN_SIMILARITY: f64 = 0.6;

/// The message for a `key` that is not a setting.
pub(crate) fn unknown(key: &str, names: &[String]) -> String {
    let plain = key.to_lowercase().replace('-', "_");
    let likeness = |name: &String| strsim::normalized_damerau_levenshtein(&plain, name);
    let nearest =
        names.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b))).filter(|n| likeness(n) >= MIN_SIMILARITY);
    let question = nearest.map_or(String::new(), |name| format!("did you mean `{name}`? "));
    format!("unknown setting; {question}The settings are {}", names.join(", "))
}
