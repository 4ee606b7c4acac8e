//! Writes the results of a run of `train`: first the avatar, then what the evaluation found.

use anyhow::Context;
use ghand_capture::Capture;
use ghand_files::atomic_file::write_atomically;
use ghand_pictures::write_png;
use ghand_train::Trained;

use super::evaluation::Evaluated;
use super::inputs::Inputs;
use super::plan::{Plan, command};
use crate::run_files::{
    ALIGN_FILE, AVATAR_FILE, CAMERAS_FILE, CONFIG_FILE, METRICS_FILE, PAGE_FILE, POSES_FILE, REPORT_FILE,
};
use crate::train_run::full_disk::when_there_is_room;
use crate::train_run::interruption::Interruption;
use crate::train_run::live_files::write_live_files;
use crate::train_run::report_page::{Page, write_report_page};
use crate::train_run::results::{save_metrics, save_poses};

/// Writes the avatar, and the settings, cameras and poses that belong to it; removes the results of an earlier run.
pub(super) fn write_avatar(
    plan: &Plan,
    inputs: &Inputs,
    trained: &Trained,
    refined: &Capture,
    interruption: &Interruption,
) -> anyhow::Result<()> {
    let folder = &plan.folder;
    let capture = &inputs.capture;
    let avatar_path = folder.file(AVATAR_FILE);
    when_there_is_room(&avatar_path, interruption, || {
        interruption.whole(|| -> anyhow::Result<()> {
            trained.avatar.save(&avatar_path)?;
            folder.remove_other_results()?;
            let config = folder.file(CONFIG_FILE);
            let written = write_atomically(&config, plan.record.settings.to_toml().as_bytes());
            written.with_context(|| format!("{}: cannot write", config.display()))?;
            if refined.cameras != capture.cameras || !refined.color_correction.is_empty() {
                refined.save_cameras(&folder.file(CAMERAS_FILE))?;
            }
            save_poses(capture, &inputs.train_split.frames, trained, &folder.file(POSES_FILE))
        })
    })
}

/// Writes figures, pictures and the page. Unless the run was stopped, it has then ended.
pub(super) fn write_report(
    plan: &Plan,
    inputs: &Inputs,
    trained: &Trained,
    evaluated: &Evaluated,
    interruption: &Interruption,
) -> anyhow::Result<()> {
    let folder = &plan.folder;
    let Evaluated { metrics, report, outlines } = evaluated;
    let pictures = [
        ("Truth, rendering, their difference four times as strong, and the floor", report),
        ("The template's outlines before (red) and after the alignment", outlines),
    ];
    let page = Page {
        capture: &inputs.path,
        command: &command(&plan.record),
        settings: &plan.record.settings,
        metrics,
        curve: &trained.curve,
        pictures: pictures.into_iter().filter_map(|(caption, picture)| Some((caption, picture.as_ref()?))).collect(),
    };
    let report_path = folder.file(REPORT_FILE);
    when_there_is_room(&report_path, interruption, || {
        interruption.whole(|| -> anyhow::Result<()> {
            outlines.as_ref().map_or(Ok(()), |picture| write_png(&folder.file(ALIGN_FILE), picture))?;
            report.as_ref().map_or(Ok(()), |picture| write_png(&report_path, picture))?;
            write_live_files(folder.path(), &trained.curve, &trained.previews)?;
            write_report_page(&folder.file(PAGE_FILE), &page)?;
            save_metrics(metrics, &folder.file(METRICS_FILE))
        })
    })?;
    if !trained.stopped {
        folder.end(plan.keep_checkpoints > 0);
    }
    Ok(())
}
