//! Errors as exceptions.

use ghand_app::cli::{Stopped, sentence};
use pyo3::PyErr;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyValueError};

pyo3::create_exception!(ghand, Error, PyException, "What ghand refuses, or what has failed, in one sentence.");

/// The exception for an error of ghand; `KeyboardInterrupt` if its user has stopped it.
pub fn failed(error: impl Into<anyhow::Error>) -> PyErr {
    let error = error.into();
    match error.downcast_ref::<Stopped>() {
        Some(stopped) => PyKeyboardInterrupt::new_err(stopped.to_string()),
        None => Error::new_err(sentence(&error)),
    }
}

/// The exception for an argument with an impossible value.
pub fn wrong(sentence: impl Into<String>) -> PyErr {
    PyValueError::new_err(sentence.into())
}
