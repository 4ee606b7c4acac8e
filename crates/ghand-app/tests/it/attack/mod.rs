//! An attack on the programs: commands with damaged files, wrong options and blocked outputs. Each command must quickly
//! succeed or fail with one sentence, and must not leave broken files.
//!
//! `GHAND_ATTACK_CASES` and `GHAND_ATTACK_SEED` set the number of cases and the seed; a failure names the seed and the
//! case, and keeps the files.

mod cases;
mod damage;
mod judge;
mod world;

use std::sync::atomic::{AtomicU64, Ordering};

use cases::Case;
use ghand_test_support::cases;
use judge::{Outcome, judge, run};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use world::World;

/// Number of cases, usually and in long tests.
const CASES: [u64; 2] = [60, 500];
const SEED: u64 = 1;

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).ok().map_or(default, |text| text.parse().unwrap())
}

/// Case `index` of a seed depends only on these two numbers.
fn case(world: &World, seed: u64, index: u64) -> Case {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(index);
    Case::new(world, &mut random)
}

#[test]
fn the_programs_succeed_or_report_the_problem_in_one_sentence() {
    let count = number("GHAND_ATTACK_CASES", cases(CASES[0], CASES[1]));
    let seed = number("GHAND_ATTACK_SEED", SEED);
    let world = World::new();
    let next = AtomicU64::new(0);
    let attack = || {
        let mut found = vec![];
        let mut succeeded = 0;
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return (succeeded, found);
            }
            let case = case(&world, seed, index);
            let outcome = run(&case);
            succeeded += u64::from(outcome.code == Some(0));
            if let Err(problem) = judge(&case, &outcome) {
                let files = case.folder.keep();
                found.push(format!(
                    "seed {seed}, case {index}, `{}`: {problem}\n  files: {}\n  stderr: {}",
                    case.command.join(" "),
                    files.display(),
                    outcome.stderr.trim_end()
                ));
            }
        }
    };
    let mut succeeded = 0;
    let mut found = vec![];
    std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
        let attackers: Vec<_> = (0..threads).map(|_| scope.spawn(attack)).collect();
        for attacker in attackers {
            let (more, problems) = attacker.join().unwrap();
            succeeded += more;
            found.extend(problems);
        }
    });
    println!("{count} cases: {succeeded} succeeded, {} ended badly", found.len());
    assert!(found.is_empty(), "{} of {count}:\n{}", found.len(), found.join("\n"));
    // An attack in which all commands succeed or all fail tests nothing.
    assert!(count < 100 || (succeeded > count / 20 && succeeded < count * 4 / 5), "{succeeded} of {count} succeeded");
}

#[test]
fn the_judge_recognises_bad_ends() {
    let world = World::new();
    let case = case(&world, 0, 0);
    let outcome = |code: Option<i32>, stderr: &str| Outcome { code, stderr: stderr.into(), in_time: true };
    let accepts = |outcome: Outcome| judge(&case, &outcome).is_ok();
    assert!(accepts(outcome(Some(1), "error: a.json: fps: is -1, must be above 0\n")));
    assert!(accepts(outcome(Some(1), "[2026-11-21T00:00:00Z WARN  ghand] a.json: odd\nerror: a.json: broken\n")));
    for (code, stderr) in [
        (None, "error: killed by a signal\n"),
        (Some(101), "thread 'main' panicked at src/main.rs:1:1:\nindex out of bounds\n"),
        (Some(1), ""),
        (Some(1), "error: one\nerror: two\n"),
        (Some(1), "something else\nerror: one\n"),
        (Some(1), "error: a.json: pose: invalid type: map, expected a string\n"),
        (Some(0), "error: told, but not in the exit code\n"),
        (Some(2), "error: another exit code\n"),
    ] {
        assert!(!accepts(outcome(code, stderr)), "{code:?} {stderr}");
    }
    assert!(!accepts(Outcome { in_time: false, ..outcome(Some(0), "") }));
    std::fs::write(case.folder.path().join(".writing-abc"), "half").unwrap();
    assert!(!accepts(outcome(Some(0), "")));
}
