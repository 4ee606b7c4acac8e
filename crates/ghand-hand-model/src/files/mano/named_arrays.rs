//! The arrays of a file of MANO's model or parameters, by name, from a pickle or an archive.

use ghand_files::npz::{ArrayError, Npz, NumericArray};
use ghand_files::pickle::{Graph, Id, SparseMatrix};

use crate::HandModelError;

/// Arrays by name, from a pickled dictionary or an `.npz` archive. Nothing that a file names is executed.
pub struct NamedArrays<'a> {
    /// The file, for messages.
    pub(super) origin: &'a str,
    /// What to do when the file is not the right one.
    remedy: &'a str,
    store: Store<'a>,
}

enum Store<'a> {
    Pickle(Graph<'a>),
    Npz(Box<Npz<'a>>),
}

/// A matrix, dense or sparse.
pub(super) enum Matrix {
    Dense(NumericArray),
    Sparse(SparseMatrix),
}

impl<'a> NamedArrays<'a> {
    /// Opens the bytes of a file. `origin` is the file's name and `remedy` says what to do if the file is wrong, both
    /// for messages.
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] if it is neither, is damaged, or names a class or function that no array needs.
    pub fn open(origin: &'a str, bytes: &'a [u8], remedy: &'a str) -> Result<NamedArrays<'a>, HandModelError> {
        let fail = |field: &str, problem: String| Err(invalid(origin, field, problem));
        let store = if Npz::recognises_bytes(bytes) {
            match Npz::open(bytes) {
                Ok(npz) => Store::Npz(Box::new(npz)),
                Err(error) => return fail("npz", error.to_string()),
            }
        } else if Graph::recognises_bytes(bytes) {
            match Graph::read(bytes) {
                Ok(graph) => Store::Pickle(graph),
                Err(error) => return fail("pickle", error.to_string()),
            }
        } else {
            return fail("content", format!("is neither a pickle nor an .npz archive; {remedy}"));
        };
        if let Store::Pickle(graph) = &store
            && !graph.is_dictionary()
        {
            return fail("pickle", format!("does not contain a dictionary; {remedy}"));
        }
        Ok(NamedArrays { origin, remedy, store })
    }

    pub(super) fn invalid(&self, field: &str, problem: String) -> HandModelError {
        invalid(self.origin, field, problem)
    }

    /// Whether the key exists.
    pub fn contains(&self, key: &str) -> bool {
        match &self.store {
            Store::Pickle(graph) => graph.entry(key).is_some(),
            Store::Npz(npz) => npz.contains(key),
        }
    }

    /// The array of a key.
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] if it is missing, damaged, too large, not numeric or not finite.
    pub fn numbers(&mut self, key: &str) -> Result<NumericArray, HandModelError> {
        match self.read(key, |graph, id| graph.numbers(id))? {
            Stored::Plain(array) | Stored::Pickled(array) => self.finite(key, array),
        }
    }

    /// The matrix of a key, with only finite numbers.
    pub(super) fn matrix(&mut self, key: &str) -> Result<Matrix, HandModelError> {
        let matrix = self.read(key, |graph, id| match graph.sparse(id)? {
            Some(sparse) => Ok(Matrix::Sparse(sparse)),
            None => Ok(Matrix::Dense(graph.numbers(id)?)),
        })?;
        match matrix {
            Stored::Plain(array) | Stored::Pickled(Matrix::Dense(array)) => Ok(Matrix::Dense(self.finite(key, array)?)),
            Stored::Pickled(Matrix::Sparse(sparse)) => match sparse.entries.iter().find(|(.., v)| !v.is_finite()) {
                Some((row, column, value)) => Err(self.invalid(key, not_finite(*value, &[*row, *column]))),
                None => Ok(Matrix::Sparse(sparse)),
            },
        }
    }

    /// The text of a key, if it exists and is text.
    pub(super) fn text(&mut self, key: &str) -> Option<String> {
        match &mut self.store {
            Store::Pickle(graph) => graph.text(graph.entry(key)?),
            Store::Npz(npz) => npz.stored(key).ok()?.text(),
        }
    }

    /// The value of a key; `pickled` reads it if it is in a pickle.
    fn read<T>(
        &mut self,
        key: &str,
        pickled: impl Fn(&Graph, Id) -> Result<T, ArrayError>,
    ) -> Result<Stored<T>, HandModelError> {
        if !self.contains(key) {
            return Err(self.invalid(key, format!("is missing; {}", self.remedy)));
        }
        let value = match &mut self.store {
            Store::Pickle(graph) => {
                { graph.entry(key).ok_or_else(|| ArrayError("is missing".into())).and_then(|id| pickled(graph, id)) }
                    .map(Stored::Pickled)
            }
            Store::Npz(npz) => npz.stored(key).and_then(|stored| match stored.pickle() {
                // An object in an archive is stored as a pickle of an array.
                Some(pickle) => {
                    let graph = Graph::read(pickle).map_err(|error| ArrayError(error.to_string()))?;
                    pickled(&graph, graph.root()).map(Stored::Pickled)
                }
                None => stored.numbers().map(Stored::Plain),
            }),
        };
        value.map_err(|error| self.invalid(key, error.to_string()))
    }

    fn finite(&self, key: &str, array: NumericArray) -> Result<NumericArray, HandModelError> {
        match array.values.iter().position(|value| !value.is_finite()) {
            Some(at) => Err(self.invalid(key, not_finite(array.values[at], &place(at, &array.shape)))),
            None => Ok(array),
        }
    }
}

/// A value of an archive, stored as a NumPy array, or a value of a pickle.
enum Stored<T> {
    Plain(NumericArray),
    Pickled(T),
}

fn invalid(origin: &str, field: &str, problem: String) -> HandModelError {
    HandModelError::invalid(origin, field, problem)
}

fn not_finite(value: f64, place: &[usize]) -> String {
    format!("has {value} at {place:?}; all numbers must be finite, copy or download the file again")
}

/// The index of the `at`-th number of an array.
fn place(mut at: usize, shape: &[usize]) -> Vec<usize> {
    let mut place = vec![0; shape.len()];
    for (index, &n) in place.iter_mut().zip(shape).rev() {
        *index = at % n;
        at /= n;
    }
    place
}
