//! `ghand-lab stress`: draws adversarial hands, poses and views, takes them through the whole pipeline, from the pose to the
//! picture and back, on the device and in its f64 twin, and reports the worst of each kind.
//!
//! Errors are counted in *roundings*: how many times larger the device's error is than what the result changes by when each
//! input moves by one unit in its last place. So an ill-conditioned case is not an error, and a well-conditioned one that
//! loses digits is, whatever its size.

mod case;
mod compare;
mod hand;
mod light;
mod report;
mod view;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use ghand_render::Gpu;
use indicatif::ProgressBar;

use case::{CaseOutcome, StressSubject};
use ghand_app::cli::AdapterArgs;
use ghand_app::say;
use ghand_files::claim::Claim;
use hand::StressHand;
use report::StressReport;

/// Cases of each hand: making one takes much longer than posing it.
const CASES_PER_HAND: u64 = 50;

/// Command line of `ghand-lab stress`.
#[derive(Debug, Args)]
pub struct StressArgs {
    /// Number of cases
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..))]
    cases: u64,
    /// What is drawn: equal seeds draw equal cases
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Only this case, such as the worst of an earlier run with the same seed
    #[arg(long, value_name = "CASE", conflicts_with = "cases")]
    only: Option<u64>,
    /// Folder for stress.json and stress.md [default: none is written]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Draws and compares the cases.
///
/// # Errors
/// An error that names the cases beyond the bounds, if there are any; or the folder that cannot be written.
pub fn run(args: &StressArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let _claim = args.out.as_deref().map(Claim::folder).transpose()?;
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let numbers = match args.only {
        Some(case) => case..case.saturating_add(1),
        None => 0..args.cases,
    };
    let mut report = StressReport::new(&gpu.info.name, args.seed);
    let bar = ProgressBar::new(numbers.end - numbers.start);
    let mut next = numbers.start;
    while next < numbers.end {
        let end = numbers.end.min((next / CASES_PER_HAND + 1) * CASES_PER_HAND);
        let outcomes = gpu.retry_on_device_loss("a case", |gpu| of_one_hand(gpu, args.seed, next..end))?;
        outcomes.into_iter().for_each(|outcome| report.add(&outcome));
        bar.set_position(end - numbers.start);
        next = end;
    }
    bar.finish_and_clear();
    say!("{}", report.tables());
    if let Some(folder) = &args.out {
        report.write(folder)?;
        say!("figures: {}", folder.join("stress.md").display());
    }
    let failures = report.failures();
    if !failures.is_empty() {
        bail!("{} cases are beyond the bounds, the first: {}", failures.len(), failures[0]);
    }
    Ok(())
}

/// The outcomes of cases of the same hand.
fn of_one_hand(gpu: &Gpu, seed: u64, cases: std::ops::Range<u64>) -> anyhow::Result<Vec<CaseOutcome>> {
    let hand = StressHand::draw(gpu, seed, cases.start / CASES_PER_HAND)?;
    let mut subject = StressSubject::new(gpu, &hand)?;
    let mut outcomes = vec![];
    for number in cases {
        let run = || subject.run(gpu, seed, number);
        outcomes.push(match catch_unwind(AssertUnwindSafe(run)) {
            Ok(outcome) => outcome?,
            Err(_) => CaseOutcome::panicked(&hand, seed, number),
        });
    }
    Ok(outcomes)
}
