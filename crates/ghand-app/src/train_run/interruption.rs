//! Ctrl-C and SIGTERM.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::cli;
use crate::train_run::run_folder::Leftovers;

/// How often it is looked whether a signal has come: faster than anybody presses Ctrl-C twice.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// What is said of a run that ends before its training.
pub const BEFORE_TRAINING: &str = "stopped before the training: nothing was saved";

/// What the next signal does.
enum Response {
    /// It ends the program with this line.
    End(String),
    /// It asks for a stop; the one after it ends the program.
    Stop,
}

struct State {
    response: Response,
    leftovers: Option<Leftovers>,
}

/// Listens to signals until the program ends.
#[derive(Clone)]
pub struct Interruption {
    stop: Arc<AtomicBool>,
    state: Arc<Mutex<State>>,
}

impl Interruption {
    /// Starts to listen. At first a signal ends the program with `line`.
    ///
    /// # Errors
    /// If the system refuses handlers of signals.
    pub fn listen(line: &str) -> anyhow::Result<Interruption> {
        let state = State { response: Response::End(line.into()), leftovers: None };
        let interruption = Interruption { stop: Arc::new(AtomicBool::new(false)), state: Arc::new(Mutex::new(state)) };
        let arrived = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, arrived.clone()).context("cannot listen to Ctrl-C")?;
        }
        let listener = interruption.clone();
        let name = "signals".to_owned();
        std::thread::Builder::new()
            .name(name)
            .spawn(move || {
                loop {
                    std::thread::sleep(LOOK_EVERY);
                    if arrived.swap(false, Ordering::Relaxed) {
                        listener.respond();
                    }
                }
            })
            .context("cannot listen to Ctrl-C")?;
        Ok(interruption)
    }

    /// True once a stop has been asked for.
    pub fn stop(&self) -> &AtomicBool {
        &self.stop
    }

    /// From now on a signal asks for a stop, and a second one ends the program.
    pub fn stop_first(&self) {
        self.state().response = Response::Stop;
    }

    /// From now on a signal ends the program with `line`.
    pub fn end_with(&self, line: String) {
        self.state().response = Response::End(line);
    }

    /// What is to be removed if a signal ends the program.
    pub fn remove_at_end(&self, leftovers: Leftovers) {
        self.state().leftovers = Some(leftovers);
    }

    /// Does `work`, which writes files: no signal ends the program meanwhile, so that none is left half-written.
    pub fn whole<T>(&self, work: impl FnOnce() -> T) -> T {
        let _state = self.state();
        work()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change is one assignment.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn respond(&self) {
        let mut state = self.state();
        // A terminal has echoed ^C into the line of the progress bar.
        let before = if std::io::stderr().is_terminal() { "\n" } else { "" };
        match &state.response {
            Response::Stop => {
                self.stop.store(true, Ordering::Relaxed);
                eprintln!("{before}stopping after this iteration; Ctrl-C once more ends the program at once");
                state.response = Response::End("stopped at once: nothing was saved".into());
            }
            Response::End(line) => {
                eprintln!("{before}{line}");
                if let Some(leftovers) = &state.leftovers {
                    leftovers.remove();
                }
                // Not `std::process::exit`: that would take apart the graphics driver while it is at work.
                signal_hook::low_level::exit(cli::STOPPED.into())
            }
        }
    }
}
