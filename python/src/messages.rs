//! Lines and warnings of ghand, for the logger `ghand` of Python's `logging`.

use log::{Level, LevelFilter, Log, Metadata, Record};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Python's numbers of its levels.
const DEBUG: u8 = 10;
const INFO: u8 = 20;
const WARNING: u8 = 30;
const ERROR: u8 = 40;

/// From now on `logging` has them.
pub fn listen() {
    ghand_app::cli::send_lines_to(|line| send(INFO, line.trim()));
    // Another module of the process may have a logger of its own already.
    if log::set_logger(&ToPython).is_ok() {
        log::set_max_level(LevelFilter::Warn);
    }
}

struct ToPython;

impl Log for ToPython {
    fn enabled(&self, metadata: &Metadata) -> bool {
        // Failures of the device are returned as errors; messages of the driver would only hide them.
        metadata.level() <= Level::Warn && metadata.target().starts_with("ghand")
    }

    fn log(&self, record: &Record) {
        if self.enabled(record.metadata()) {
            let level = match record.level() {
                Level::Error => ERROR,
                Level::Warn => WARNING,
                Level::Info => INFO,
                Level::Debug | Level::Trace => DEBUG,
            };
            send(level, &record.args().to_string());
        }
    }

    fn flush(&self) {}
}

/// Logs a line. One that Python refuses is lost: there is nobody to tell.
fn send(level: u8, line: &str) {
    if line.is_empty() {
        return;
    }
    Python::attach(|py| -> PyResult<()> {
        py.import("logging")?.call_method1("getLogger", ("ghand",))?.call_method1("log", (level, "%s", line))?;
        Ok(())
    })
    .unwrap_or_default();
}

/// Shows remarks on a file as Python's warnings.
pub fn warn(py: Python<'_>, remarks: &[String]) -> PyResult<()> {
    for remark in remarks {
        let level = PyDict::new(py);
        level.set_item("stacklevel", 2)?;
        py.import("warnings")?.call_method("warn", (remark,), Some(&level))?;
    }
    Ok(())
}
