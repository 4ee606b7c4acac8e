//! The worst of each kind.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use ghand_files::atomic_file::write_atomically;
use serde::Serialize;

use super::case::{BOUNDS, CaseOutcome, STAGES};

/// The worst case of a kind in one stage.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
struct Worst {
    roundings: f64,
    case: u64,
}

/// All cases of a kind.
#[derive(Debug, Clone, Default, Serialize)]
struct Kind {
    cases: u64,
    /// By stage.
    worst: [Option<Worst>; 5],
    /// Mean part of the pixels that rounding may have decided otherwise.
    flipped: f64,
    /// Cases in which rounding may decide which of two Gaussians is in front, so that pictures are not compared.
    undecided: u64,
    /// Of baked hands in fewer bits than f32: the largest distance from what f32 gives, as a part of the hand's extent, and
    /// difference of colours.
    packing: Option<[f64; 2]>,
}

/// What is kept of a run.
#[derive(Debug, Serialize)]
pub struct StressReport {
    adapter: String,
    seed: u64,
    stages: [&'static str; 5],
    bounds: [f64; 5],
    all: Kind,
    hands: BTreeMap<&'static str, Kind>,
    models: BTreeMap<&'static str, Kind>,
    poses: BTreeMap<&'static str, Kind>,
    views: BTreeMap<&'static str, Kind>,
    failures: Vec<String>,
}

impl Kind {
    fn add(&mut self, outcome: &CaseOutcome) {
        self.cases += 1;
        self.undecided += u64::from(outcome.undecided);
        if let Some(packing) = outcome.packing {
            let worst = self.packing.get_or_insert([0.0; 2]);
            *worst = [0, 1].map(|i| worst[i].max(packing[i]));
        }
        self.flipped += (outcome.flipped - self.flipped) / self.cases as f64;
        for (worst, roundings) in self.worst.iter_mut().zip(outcome.roundings) {
            let Some(roundings) = roundings else { continue };
            if worst.is_none_or(|worst| worst.roundings < roundings) {
                *worst = Some(Worst { roundings, case: outcome.number });
            }
        }
    }
}

impl StressReport {
    pub fn new(adapter: &str, seed: u64) -> StressReport {
        StressReport {
            adapter: adapter.to_owned(),
            seed,
            stages: STAGES,
            bounds: BOUNDS,
            all: Kind::default(),
            hands: BTreeMap::new(),
            models: BTreeMap::new(),
            poses: BTreeMap::new(),
            views: BTreeMap::new(),
            failures: vec![],
        }
    }

    /// Adds a case.
    pub fn add(&mut self, outcome: &CaseOutcome) {
        self.all.add(outcome);
        self.hands.entry(outcome.hand.name()).or_default().add(outcome);
        self.models.entry(outcome.model.name()).or_default().add(outcome);
        self.poses.entry(outcome.pose.name()).or_default().add(outcome);
        self.views.entry(outcome.view.name()).or_default().add(outcome);
        let mut problems: Vec<String> = outcome.problem.iter().cloned().collect();
        for (stage, (roundings, bound)) in outcome.roundings.iter().zip(BOUNDS).enumerate() {
            if roundings.is_some_and(|roundings| roundings.is_nan() || roundings > bound) {
                let table = outcome.worst_table.iter().filter(|_| stage == 3).map(|name| format!(" ({name})"));
                let table: String = table.collect();
                problems.push(format!("{}{table}: {:.0} roundings", STAGES[stage], roundings.unwrap_or(f64::NAN)));
            }
        }
        if !problems.is_empty() {
            self.failures.push(format!(
                "case {} of seed {} (hand: {}, {}; pose: {}; view: {}): {}",
                outcome.number,
                self.seed,
                outcome.hand.name(),
                outcome.model.name(),
                outcome.pose.name(),
                outcome.view.name(),
                problems.join(", ")
            ));
        }
    }

    /// What is beyond the bounds.
    pub fn failures(&self) -> &[String] {
        &self.failures
    }

    /// Markdown tables of the worst of each kind.
    pub fn tables(&self) -> String {
        let mut text =
            format!("{} cases, seed {}; roundings of the worst case (its number)\n", self.all.cases, self.seed);
        let groups = [("hand", &self.hands), ("model", &self.models), ("pose", &self.poses), ("view", &self.views)];
        for (name, kinds) in groups {
            text +=
                &format!("\n| {name} | cases | {} | flipped pixels | order undecided |\n|---|---|", STAGES.join(" | "));
            text += &"---|".repeat(STAGES.len() + 2);
            for (kind, figures) in kinds {
                text += &format!("\n{}", line(kind, figures));
            }
            text += &format!("\n{}\n", line("all", &self.all));
        }
        for (model, kind) in &self.models {
            if let Some([distance, color]) = kind.packing {
                let percent = 100.0 * distance;
                text += &format!("\n{model}: at most {percent:.3} % of the hand and {color:.4} of colour from f32\n");
            }
        }
        for failure in &self.failures {
            text += &format!("\n{failure}");
        }
        text
    }

    /// Writes the figures and their tables.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            write_atomically(&path, bytes).with_context(|| format!("{}: cannot be written", path.display()))
        };
        let head = format!("# Stress\n\nOn {}: ", self.adapter);
        write("stress.md", format!("{head}{}\n", self.tables()).as_bytes())?;
        write("stress.json", &serde_json::to_vec_pretty(self)?)
    }
}

fn line(name: &str, kind: &Kind) -> String {
    let cell =
        |worst: &Option<Worst>| worst.map_or("".to_owned(), |worst| format!("{:.1} ({})", worst.roundings, worst.case));
    let cells: Vec<String> = kind.worst.iter().map(cell).collect();
    let [flipped, undecided] =
        [kind.flipped, kind.undecided as f64 / kind.cases.max(1) as f64].map(|part| 100.0 * part);
    format!("| {name} | {} | {} | {flipped:.2} % | {undecided:.1} % |", kind.cases, cells.join(" | "))
}
