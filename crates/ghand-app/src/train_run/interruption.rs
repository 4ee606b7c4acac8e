//! Ctrl-C and SIGTERM, or the wish of a program that runs a command inside itself.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::Context;
use ghand_files::temporary;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::cli::Stopped;
use crate::train_run::run_folder::Leftovers;

/// Interval of checks for signals: shorter than the time between two presses of Ctrl-C.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Exit code of a program that the user has stopped, the same as for Ctrl-C.
pub const STOPPED: u8 = 130;

/// Message of a run that ends before its training.
pub const STOPPED_BEFORE_TRAINING: &str = "stopped before training: nothing was saved";

/// What the next signal does.
enum Response {
    /// It ends the program with this line.
    End(String),
    /// It requests a stop; the next one ends the program.
    Stop,
}

struct State {
    response: Response,
    leftovers: Option<Leftovers>,
}

/// Listens for signals until the program ends, or for the wish of a host.
#[derive(Clone)]
pub struct Interruption {
    /// Whether another program runs the command inside itself: it is not ended, and handles signals on its own.
    hosted: bool,
    stop: Arc<AtomicBool>,
    state: Arc<Mutex<State>>,
}

impl Interruption {
    /// Lets a signal end the program with `line`, and listens from the first call until the program ends.
    ///
    /// # Errors
    /// If the system rejects the signal handlers.
    pub fn listen(line: &str) -> anyhow::Result<Interruption> {
        static LISTENING: Mutex<Option<Interruption>> = Mutex::new(None);
        let mut listening = LISTENING.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = listening.as_ref() {
            known.end_with(line.into());
            return Ok(known.clone());
        }
        let state = State { response: Response::End(line.into()), leftovers: None };
        let stop = Arc::new(AtomicBool::new(false));
        let interruption = Interruption { hosted: false, stop, state: Arc::new(Mutex::new(state)) };
        interruption.start()?;
        Ok(listening.insert(interruption).clone())
    }

    /// Of a command inside another program, which sets `stop` when it wants an end. Signals are the program's own.
    pub fn of_host(stop: Arc<AtomicBool>) -> Interruption {
        let state = State { response: Response::End("stopped".into()), leftovers: None };
        Interruption { hosted: true, stop, state: Arc::new(Mutex::new(state)) }
    }

    /// Whether a host wants an end. Without one always `false`: there a signal ends the program by itself.
    pub fn ends(&self) -> bool {
        self.hosted && self.stop.load(Ordering::Relaxed)
    }

    /// Ends the command if its host wants that; to be called between steps, and before results are written.
    ///
    /// # Errors
    /// [`Stopped`] with the present line.
    pub fn check(&self) -> Result<(), Stopped> {
        if !self.ends() {
            return Ok(());
        }
        Err(Stopped(match &self.state().response {
            Response::End(line) => line.clone(),
            Response::Stop => "stopped".into(),
        }))
    }

    fn start(&self) -> anyhow::Result<()> {
        let arrived = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, arrived.clone()).context("cannot handle Ctrl-C")?;
        }
        let listener = self.clone();
        let listen = move || {
            loop {
                std::thread::sleep(LOOK_EVERY);
                if arrived.swap(false, Ordering::Relaxed) {
                    listener.respond();
                }
            }
        };
        let started = std::thread::Builder::new().name("signals".into()).spawn(listen);
        started.map(|_| ()).context("cannot handle Ctrl-C")
    }

    /// True once a stop has been requested.
    pub fn stop(&self) -> &AtomicBool {
        &self.stop
    }

    /// From now on a signal requests a stop, and a second one ends the program.
    pub fn stop_first(&self) {
        self.state().response = Response::Stop;
    }

    /// From now on a signal ends the program with `line`.
    pub fn end_with(&self, line: String) {
        self.state().response = Response::End(line);
    }

    /// Files and folders to remove if a signal ends the program.
    pub fn remove_at_end(&self, leftovers: Leftovers) {
        self.state().leftovers = Some(leftovers);
    }

    /// Runs `work`, which writes files. No signal ends the program meanwhile, so that no file is left half-written.
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
        // A terminal echoes ^C into the line of the progress bar.
        let before = if std::io::stderr().is_terminal() { "\n" } else { "" };
        match &state.response {
            Response::Stop => {
                self.stop.store(true, Ordering::Relaxed);
                eprintln!("{before}stopping after this iteration; press Ctrl-C again to end the program at once");
                state.response = Response::End("stopped at once".into());
            }
            Response::End(line) => {
                match state.leftovers.as_ref().and_then(Leftovers::how_to_resume) {
                    Some(hint) => eprintln!("{before}{line}; {hint}"),
                    None => eprintln!("{before}{line}"),
                }
                if let Some(leftovers) = &state.leftovers {
                    leftovers.remove();
                }
                temporary::remove_all();
                // Not `std::process::exit`: that would unload the graphics driver while it is working.
                signal_hook::low_level::exit(STOPPED.into())
            }
        }
    }
}
