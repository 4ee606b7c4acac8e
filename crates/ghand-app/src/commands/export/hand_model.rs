//! A hand model as a rigged `.glb`.

use std::path::Path;

use anyhow::{Context, bail};
use ghand_core::HandModel;
use ghand_files::atomic_file::write_atomically;
use ghand_hand_model::files::rigged_glb::RiggedHand;
use ghand_hand_model::joints::axes::why_without_axes;
use ghand_hand_model::pose_correctives::fit_pose_directions;

use super::ExportArgs;
use crate::say;

/// Writes the hand at rest with its skeleton, shapes and pose correctives.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn write(args: &ExportArgs, out: &Path) -> anyhow::Result<()> {
    let only_avatars =
        [("--pose", !args.pose.is_empty()), ("--texture", args.texture.is_some()), ("--gaussians", args.gaussians)];
    let file = args.reading.load(Some(&args.subject))?;
    if let Some((option, _)) = only_avatars.into_iter().find(|(_, given)| *given) {
        bail!(
            "{option}: {} is a hand model, which is written at rest and without a skin; give an avatar, or omit \
             {option}",
            args.subject.display()
        );
    }
    for warning in &file.warnings {
        log::warn!("{warning}");
    }
    let mut model = file.model;
    if args.fit_pose_correctives {
        fit_correctives(&mut model, &args.subject)?;
    }
    let names = args.joint_names.map(|names| names.of(&model.joint_names));
    let hand = RiggedHand { joint_names: names.as_deref(), ..RiggedHand::default() };
    let bytes = hand.document(&model)?.finish()?;
    write_atomically(out, &bytes).with_context(|| format!("{}: cannot write the hand model", out.display()))?;
    say!(
        "{}: {} vertices, {} joints, {} shapes, {} pose directions",
        out.display(),
        model.vertices.len(),
        model.joint_count(),
        model.shape_count(),
        model.pose_directions.len() / model.vertices.len().max(1)
    );
    Ok(())
}

/// Gives a hand the pose correctives that keep the volume of its bent joints.
///
/// # Errors
/// An error that names the hand if its joints' names do not tell how they bend.
pub fn fit_correctives(model: &mut HandModel, subject: &Path) -> anyhow::Result<()> {
    model.pose_directions = fit_pose_directions(model).with_context(|| {
        let cause = why_without_axes(&model.joint_names);
        format!("--fit-pose-correctives: {}: {cause}", subject.display())
    })?;
    Ok(())
}
