//! Training and evaluation, as the programs do them.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use clap::Parser;
use ghand_app::cli::AdapterArgs;
use ghand_app::commands::evaluate::{EvaluateArgs, run_watched as run_evaluation};
use ghand_app::commands::train::{TrainArgs, run_watched as run_training};
use ghand_app::run_files::{AVATAR_FILE, METRICS_FILE};
use ghand_app::runtime_dir::RuntimeDir;
use ghand_app::train_run::interruption::Interruption;
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};

use crate::error::{failed, wrong};

/// Time between two looks for Ctrl-C.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// How far a training is.
#[pyclass(frozen, get_all, module = "ghand")]
pub struct Progress {
    /// Iterations done.
    iteration: u64,
    /// Iterations in all.
    iterations: u64,
    /// 1 while poses are refined, then 2.
    stage: u32,
    /// Mean absolute error of the last images, once there are enough.
    l1: Option<f64>,
    /// PSNR of images held out, dB, once it was measured.
    held_out_psnr: Option<f64>,
}

#[pymethods]
impl Progress {
    fn __repr__(&self) -> String {
        format!("<ghand.Progress {} of {} iterations>", self.iteration, self.iterations)
    }
}

/// What a training has made.
#[pyclass(frozen, get_all, module = "ghand")]
pub struct TrainResult {
    /// Its folder.
    folder: PathBuf,
    /// The avatar's file.
    avatar: PathBuf,
    /// The contents of `metrics.json`.
    metrics: Py<PyAny>,
}

#[pymethods]
impl TrainResult {
    fn __repr__(&self) -> String {
        format!("<ghand.TrainResult {}>", self.avatar.display())
    }
}

#[derive(Parser)]
struct TrainLine {
    #[command(flatten)]
    train: TrainArgs,
    #[command(flatten)]
    adapter: AdapterArgs,
}

#[derive(Parser)]
struct EvaluateLine {
    #[command(flatten)]
    evaluate: EvaluateArgs,
    #[command(flatten)]
    adapter: AdapterArgs,
}

/// Trains an avatar, as the program `train` does. `options` are its other options, with underscores.
#[pyfunction]
#[pyo3(signature = (capture=None, out=None, settings=None, on_progress=None, **options))]
pub fn train(
    py: Python<'_>,
    capture: Option<PathBuf>,
    out: Option<PathBuf>,
    settings: Option<&Bound<'_, PyDict>>,
    on_progress: Option<Py<PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<TrainResult> {
    if let Some(callback) = on_progress.as_ref().filter(|callback| !callback.bind(py).is_callable()) {
        return Err(PyTypeError::new_err(format!("on_progress: must be callable, not {}", callback.bind(py).repr()?)));
    }
    let mut line = Line::new("train").option("capture", capture).option("out", out);
    for (key, value) in settings.into_iter().flatten() {
        line.0.extend(["--set".into(), format!("{}={}", key.str()?, text(&value)?).into()]);
    }
    let line: TrainLine = line.options(options)?.parse()?;
    let folder = watched(py, on_progress, move |stop, progress| {
        let mut watch = |now: &ghand_train::TrainingProgress| {
            let held_out_psnr = now.curve.iter().rev().find_map(|point| point.held_out_psnr);
            let &ghand_train::TrainingProgress { iteration, iterations, stage, l1, .. } = now;
            // Nobody listens once the interpreter has gone on.
            let _ = progress.send(Progress { iteration, iterations, stage, l1, held_out_psnr });
        };
        run_training(&line.train, &line.adapter, &Interruption::of_host(stop), Some(&mut watch))
    })?;
    Ok(TrainResult { avatar: folder.join(AVATAR_FILE), metrics: metrics(py, folder.join(METRICS_FILE))?, folder })
}

/// Compares an avatar with images of a capture, as `ghand evaluate` does; returns the contents of `metrics.json`. `options`
/// are its other options, with underscores.
#[pyfunction]
#[pyo3(signature = (avatar, capture, out=None, **options))]
pub fn evaluate(
    py: Python<'_>,
    avatar: PathBuf,
    capture: PathBuf,
    out: Option<PathBuf>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<PyAny>> {
    let temporary = tempfile::tempdir()?;
    let out = out.unwrap_or_else(|| temporary.path().join("evaluation"));
    let line = Line::new("evaluate").option("capture", Some(capture)).option("out", Some(out.clone()));
    let mut line = line.options(options)?;
    line.0.extend(["--".into(), avatar.into()]);
    let line: EvaluateLine = line.parse()?;
    watched(py, None, move |stop, _| run_evaluation(&line.evaluate, &line.adapter, &Interruption::of_host(stop)))?;
    metrics(py, out.join(METRICS_FILE))
}

/// The contents of a JSON file; `None` if there is none: without images to compare with there are no figures.
fn metrics(py: Python<'_>, file: PathBuf) -> PyResult<Py<PyAny>> {
    if !file.exists() {
        return Ok(py.None());
    }
    Ok(py.import("json")?.call_method1("loads", (std::fs::read_to_string(file)?,))?.unbind())
}

/// A command line.
struct Line(Vec<OsString>);

impl Line {
    fn new(program: &str) -> Line {
        Line(vec![program.into()])
    }

    fn option(mut self, name: &str, value: Option<PathBuf>) -> Line {
        if let Some(value) = value {
            self.0.extend([format!("--{name}").into(), value.into()]);
        }
        self
    }

    /// Keywords as options: `ignore_checks=True` is `--ignore-checks`.
    fn options(mut self, options: Option<&Bound<'_, PyDict>>) -> PyResult<Line> {
        for (name, value) in options.into_iter().flatten() {
            let name = format!("--{}", name.str()?.to_str()?.replace('_', "-"));
            match value.cast::<PyBool>() {
                Ok(wanted) if wanted.is_true() => self.0.push(name.into()),
                Ok(_) => {}
                Err(_) if value.is_none() => {}
                Err(_) => self.0.extend([name.into(), text(&value)?.into()]),
            }
        }
        Ok(self)
    }

    /// # Errors
    /// `ValueError` with the sentence of the program.
    fn parse<T: Parser>(self) -> PyResult<T> {
        T::try_parse_from(self.0).map_err(|error| {
            let message = error.to_string();
            let sentence = message.split("\n\n").next().unwrap_or(&message);
            wrong(sentence.trim_start_matches("error: ").split_whitespace().collect::<Vec<_>>().join(" "))
        })
    }
}

/// A value as on a command line.
fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    match value.cast::<PyBool>() {
        Ok(value) => Ok(value.is_true().to_string()),
        Err(_) => Ok(value.str()?.to_str()?.to_owned()),
    }
}

/// Runs `work` on a thread of its own, hands its progress to `on_progress`, and stops it at Ctrl-C or when `on_progress`
/// raises; a second Ctrl-C does not wait until it has stopped.
fn watched<T: Send + 'static>(
    py: Python<'_>,
    on_progress: Option<Py<PyAny>>,
    work: impl FnOnce(Arc<AtomicBool>, Sender<Progress>) -> anyhow::Result<T> + Send + 'static,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (progress, mut news) = channel();
    let wants = stop.clone();
    let worker = std::thread::Builder::new().name("ghand".into()).spawn(move || {
        let _runtime_dir = RuntimeDir::ensure();
        work(wants, progress)
    })?;
    let mut raised: Option<PyErr> = None;
    loop {
        let receiver = &mut news;
        let last = py
            .detach(move || receiver.recv_timeout(LOOK_EVERY).map(|first| receiver.try_iter().last().unwrap_or(first)));
        let told = match (last, &on_progress) {
            (Ok(progress), Some(callback)) if raised.is_none() => callback.call1(py, (progress,)).map(|_| ()),
            (Err(RecvTimeoutError::Disconnected), _) => break,
            _ => Ok(()),
        };
        if let Err(error) = told.and_then(|()| py.check_signals()) {
            stop.store(true, Ordering::Relaxed);
            if let Some(first) = raised.replace(error) {
                return Err(first);
            }
        }
    }
    let ended = py.detach(|| worker.join()).map_err(|_| PyRuntimeError::new_err("ghand has panicked: see stderr"))?;
    match (raised, ended.map_err(failed)) {
        // The line says what was saved.
        (Some(interrupt), Err(stopped)) if interrupt.get_type(py).is(stopped.get_type(py)) => Err(stopped),
        (Some(error), _) => Err(error),
        (None, ended) => ended,
    }
}
