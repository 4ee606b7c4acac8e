//! Frames at the moment at which they come, from a camera or from a video that plays like one.
//!
//! ffmpeg runs beside this program and writes pictures into a pipe. A thread reads all of them at once and keeps only the
//! newest, so that frames are never late, however slow their user is.

mod camera;
mod complaint;
mod newest;
mod ppm;
mod source;
mod system;

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use self::complaint::Reason;
use self::newest::Newest;
use crate::FootageError;
use crate::video::programs::Program;

pub use newest::LiveFrame;
pub use source::LiveSource;

/// Most bytes of ffmpeg's messages that are kept.
const LONGEST_COMPLAINT: usize = 2000;

/// Frames of a camera or of a video, which repeats from its end. Dropping them, or [`LiveFrames::stop`], ends ffmpeg.
pub struct LiveFrames {
    shared: Arc<Shared>,
    reader: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    newest: Newest,
    decoder: Mutex<Decoder>,
}

/// The running ffmpeg.
#[derive(Default)]
struct Decoder {
    child: Option<Child>,
    is_stopped: bool,
}

impl LiveFrames {
    /// Starts ffmpeg, which may take seconds to open a camera. What goes wrong is told by [`LiveFrames::take`].
    ///
    /// # Errors
    /// If no thread can be started.
    pub fn start(source: LiveSource) -> Result<LiveFrames, FootageError> {
        let shared = Arc::new(Shared::default());
        let path = source.name();
        let read = {
            let shared = shared.clone();
            move || {
                let end = shared.read(&source);
                shared.newest.end(end);
            }
        };
        let thread = thread::Builder::new().name("live frames".into()).spawn(read);
        let reader = thread.map_err(FootageError::file(Path::new(&path)))?;
        Ok(LiveFrames { shared, reader: Some(reader) })
    }

    /// The newest frame that was not taken yet, `None` if none comes within `patience`.
    ///
    /// # Errors
    /// Once, after the last frame, why no others come, in one sentence: the camera is missing, used by another program,
    /// not allowed, or was unplugged; ffmpeg is not installed.
    pub fn take(&self, patience: Duration) -> Result<Option<LiveFrame>, FootageError> {
        self.shared.newest.take(patience)
    }

    /// Frames that newer ones overtook before they were taken.
    pub fn dropped(&self) -> u64 {
        self.shared.newest.dropped()
    }

    /// Ends ffmpeg. No more frames come.
    pub fn stop(&self) {
        let mut decoder = self.shared.decoder();
        decoder.is_stopped = true;
        decoder.end();
        self.shared.newest.end(None);
    }
}

impl Drop for LiveFrames {
    fn drop(&mut self) {
        self.stop();
        // Its pipe is closed.
        self.reader.take().into_iter().for_each(|reader| _ = reader.join());
    }
}

impl Decoder {
    fn end(&mut self) {
        if let Some(mut child) = self.child.take() {
            // Nothing to do if it has ended, and no way to report if it cannot be stopped.
            _ = child.kill();
            _ = child.wait();
        }
    }
}

impl Shared {
    fn decoder(&self) -> MutexGuard<'_, Decoder> {
        self.decoder.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads frames until they end. Returns why, unless they were stopped.
    fn read(&self, source: &LiveSource) -> Option<FootageError> {
        let name = source.name();
        let path = Path::new(&name);
        let mut complaint = String::new();
        for command in source.commands() {
            let (frames, told) = match self.spawn(command) {
                Ok(pipes) => pipes?,
                Err(error) => return Some(Program::Ffmpeg.failure(path)(error)),
            };
            let listener = thread::spawn(move || listen(told));
            let count = self.pass_on(frames);
            self.decoder().end();
            complaint = listener.join().unwrap_or_default();
            if self.decoder().is_stopped {
                return None;
            }
            if count > 0 {
                return Some(FootageError::unusable(path, ended(source, &complaint)));
            }
            // Asking for less would not help.
            if Reason::of(&complaint).is_some() {
                break;
            }
        }
        Some(FootageError::unusable(path, refused(source, &complaint)))
    }

    /// Starts ffmpeg, unless all was stopped.
    fn spawn(&self, mut command: Command) -> std::io::Result<Option<(ChildStdout, ChildStderr)>> {
        let mut decoder = self.decoder();
        if decoder.is_stopped {
            return Ok(None);
        }
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
        let pipes = child.stdout.take().zip(child.stderr.take());
        decoder.child = Some(child);
        Ok(pipes)
    }

    /// Passes on frames until they end. Returns their number.
    fn pass_on(&self, frames: ChildStdout) -> u64 {
        let mut frames = BufReader::with_capacity(1 << 16, frames);
        let mut count = 0;
        while let Ok(Some((width, height, rgb))) = ppm::next_picture(&mut frames) {
            self.newest.put(LiveFrame { width, height, rgb, arrived: Instant::now() });
            count += 1;
        }
        count
    }
}

/// The errors that ffmpeg tells until it ends, the first ones.
fn listen(told: ChildStderr) -> String {
    let mut complaint = String::new();
    let mut lines = BufReader::new(told);
    let mut line = vec![];
    loop {
        line.clear();
        if !matches!(lines.by_ref().read_until(b'\n', &mut line), Ok(1..)) {
            return complaint;
        }
        let text = String::from_utf8_lossy(&line);
        if let Some((_, problem)) = text.split_once("[error] ").or_else(|| text.split_once("[fatal] "))
            && complaint.len() < LONGEST_COMPLAINT
        {
            if !complaint.is_empty() {
                complaint += "\n";
            }
            complaint.extend(problem.trim().chars().filter(|c| !c.is_control()).take(300));
        }
    }
}

/// Why not a single frame came; continues the source's name.
fn refused(source: &LiveSource, complaint: &str) -> String {
    let first = complaint.lines().next().unwrap_or("it gives no reason");
    match source.system() {
        None => format!("ffmpeg cannot decode any frame of it ({first}); convert it to H.264, or record again"),
        Some(system) => match Reason::of(complaint) {
            Some(reason) => reason.sentence(system).into(),
            None => {
                format!("ffmpeg gets no pictures from it ({first}); try another program, then choose another camera")
            }
        },
    }
}

/// Why frames have ended; continues the source's name.
fn ended(source: &LiveSource, complaint: &str) -> String {
    let last = complaint.lines().last().map(|last| format!(" ({last})")).unwrap_or_default();
    match source.system() {
        None => format!("ffmpeg has stopped reading it{last}; start it again"),
        Some(_) => format!("gives no more pictures{last}; connect it again, then start it again"),
    }
}

#[cfg(test)]
mod tests;
