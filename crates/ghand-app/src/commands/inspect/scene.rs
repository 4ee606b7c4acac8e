//! Describes a scene of Gaussians.

use std::path::Path;

use ghand_avatar::scene_files::{Antialiasing, SplatScene};
use ghand_core::statistics::quantile;

/// Names of the stored numbers before the harmonics, in the order of the table.
const ROWS: [&str; 14] = [
    "x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0", "f_dc_1",
    "f_dc_2",
];

/// The description of a scene with its oddities, as lines.
pub fn describe(path: &Path, scene: &SplatScene) -> String {
    let mut lines = vec![format!("{}: scene of Gaussians", path.display())];
    let mut row = |name: &str, text: String| lines.push(format!("  {name:<12} {text}"));
    row("file", file_size(path));
    row("Gaussians", scene.count.to_string());
    row("harmonics", format!("degree {}", scene.degree));
    let column = |name: &str| scene.row(ROWS.iter().position(|own| *own == name).unwrap_or(0));
    let ranges = ["x", "y", "z"].map(|name| spread(column(name)));
    if let [Some(x), Some(y), Some(z)] = ranges {
        let corner = |end: usize| format!("({:.4}, {:.4}, {:.4})", x[end], y[end], z[end]);
        row("extents", format!("{} to {}", corner(0), corner(2)));
    }
    let sizes = ["scale_0", "scale_1", "scale_2"].into_iter().flat_map(column).map(|logarithm| logarithm.exp());
    if let Some([low, median, high]) = spread(sizes) {
        row("sizes", format!("{low:.3e} to {high:.3e}, half of them below {median:.3e}"));
    }
    let opacities = column("opacity").map(|logit| 1.0 / (1.0 + (-logit).exp()));
    if let Some([low, median, high]) = spread(opacities) {
        row("opacities", format!("{low:.4} to {high:.4}, half of them below {median:.4}"));
    }
    row(
        "antialiasing",
        if scene.antialias == Antialiasing::Off { "the file does not say so".into() } else { "yes".into() },
    );
    let mut warnings = scene.suspicions();
    let not_finite: Vec<(&str, usize)> = (0..scene.model().rows())
        .map(|row| {
            let name = ROWS.get(row).copied().unwrap_or("f_rest");
            (name, scene.row(row).filter(|value| !value.is_finite()).count())
        })
        .filter(|(_, count)| *count > 0)
        .collect();
    if !not_finite.is_empty() {
        let total: usize = not_finite.iter().map(|(_, count)| count).sum();
        let mut names: Vec<&str> = not_finite.iter().map(|(name, _)| *name).collect();
        names.dedup();
        warnings.push(format!("{total} numbers are not finite, in {}", names.join(", ")));
    }
    let turns = ["rot_0", "rot_1", "rot_2", "rot_3"].map(|name| column(name).collect::<Vec<f32>>());
    let zero = (0..scene.count).filter(|k| turns.iter().all(|turn| turn.get(*k) == Some(&0.0))).count();
    if zero > 0 {
        warnings.push(format!("{zero} quaternions are all zeros, which is not a rotation"));
    }
    if warnings.is_empty() {
        row("warnings", "none: all numbers are finite".into());
    }
    warnings.into_iter().for_each(|warning| row("warning", warning));
    lines.join("\n") + "\n"
}

/// Size of a file as text.
pub(super) fn file_size(path: &Path) -> String {
    match std::fs::metadata(path) {
        Ok(data) => format!("{} bytes ({:.1} MiB)", data.len(), data.len() as f64 / f64::from(1 << 20)),
        Err(error) => format!("its size cannot be read: {error}"),
    }
}

/// The smallest, the middle and the largest of the finite numbers; `None` if there are none.
fn spread(values: impl Iterator<Item = f32>) -> Option<[f64; 3]> {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).map(f64::from).collect();
    (!values.is_empty()).then(|| [0.0, 0.5, 1.0].map(|fraction| quantile(values.iter().copied(), fraction)))
}
