//! Names of the files in a run's folder.

/// The avatar in a run's folder.
pub const AVATAR_FILE: &str = "avatar.ghand";
/// The refined poses in a run's folder.
pub const POSES_FILE: &str = "poses.json";
/// The cameras in a run's folder, if the alignment refined them.
pub const CAMERAS_FILE: &str = "cameras.json";
/// The figures in a run's folder.
pub const METRICS_FILE: &str = "metrics.json";
/// The picture in a run's folder.
pub const REPORT_FILE: &str = "report.png";
/// The template's outlines before and after the alignment, in a run's folder.
pub const ALIGN_FILE: &str = "align.png";
/// The settings of a run, in its folder; `train --config` takes them.
pub const CONFIG_FILE: &str = "config.toml";
/// A run on one page.
pub const PAGE_FILE: &str = "report.html";
/// The loss and the PSNR of images held out, over the run, as a table.
pub const CURVES_TABLE: &str = "curves.csv";
/// The same as a plot.
pub const CURVES_PLOT: &str = "curves.png";
/// Images held out above the avatar.
pub const PREVIEW: &str = "preview.png";
/// All results of a run or an evaluation.
pub const RESULTS: [&str; 11] = [
    AVATAR_FILE,
    CAMERAS_FILE,
    CONFIG_FILE,
    POSES_FILE,
    METRICS_FILE,
    REPORT_FILE,
    PAGE_FILE,
    ALIGN_FILE,
    CURVES_TABLE,
    CURVES_PLOT,
    PREVIEW,
];
/// The folder in a run's folder that has what an interrupted run needs to go on.
pub const CHECKPOINTS: &str = "checkpoints";
/// How a run was started, in that folder. Without it there is nothing to go on with.
pub const RECORD_FILE: &str = "run.json";
/// The avatar as it was last shown, in the folder of a run's checkpoints.
pub const PREVIEW_AVATAR: &str = "preview.ghand";
