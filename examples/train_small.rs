//! Trains a small avatar on a synthetic capture, in about half a minute, and writes it to `small.ghand`.
//!
//!     cargo run --example train_small
//!
//! `train` does the same with checks, figures and files around it; this is the part in the middle.

use ghand::prelude::*;
use ghand::synthetic::SyntheticOptions;
use ghand::synthetic::make_capture::make_capture;

fn main() -> anyhow::Result<()> {
    let gpu = Gpu::new(&AdapterChoice::from_env())?;
    let folder = tempfile::tempdir()?;
    let options = SyntheticOptions { views: 4, train_frames: 6, width: 96, height: 144, ..Default::default() };
    make_capture(&gpu, &options, folder.path())?;
    let capture = Capture::open(folder.path())?;

    let settings = TrainSettings { iterations: 200, uv_resolution: 48, ..Default::default() };
    let trained = Trainer::new(&gpu, &capture, "train", &settings)?.train(|progress| {
        if progress.iteration.is_multiple_of(50) {
            let loss = progress.l1.map_or_else(String::new, |l1| format!(", L1 {l1:.4}"));
            println!("{}/{}, stage {}{loss}", progress.iteration, progress.iterations, progress.stage);
        }
    })?;
    trained.avatar.save("small.ghand".as_ref())?;
    println!("small.ghand: {} Gaussians; look at it with `viewer small.ghand`", trained.avatar.template.len());
    Ok(())
}
