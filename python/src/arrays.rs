//! Arrays in and out.

use glam::{DMat3, DVec3};
use numpy::ndarray::{Array, Array2, Dimension};
use numpy::{IntoPyArray, PyArray, PyArray2, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::error::wrong;

/// Numbers in rows, whatever they were: a NumPy array of any type and layout, a list, a tensor on the CPU.
pub struct Numbers {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// Row-major.
    pub values: Vec<f64>,
}

impl Numbers {
    /// The numbers of the argument `name`.
    ///
    /// # Errors
    /// `TypeError` if they are no numbers, `ValueError` if one is not finite.
    pub fn of(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Numbers> {
        let numpy = value.py().import("numpy")?;
        let no_numbers = |what: &str| PyTypeError::new_err(format!("{name}: must be an array of numbers, not {what}"));
        let given = numpy.call_method1("asarray", (value,)).map_err(|error| no_numbers(&error.to_string()))?;
        let kind: String = given.getattr("dtype")?.getattr("kind")?.extract()?;
        if !["f", "i", "u"].contains(&kind.as_str()) {
            return Err(no_numbers(&format!("of type {}", given.getattr("dtype")?.str()?)));
        }
        let array = numpy.call_method1("ascontiguousarray", (&given, "float64"))?;
        let array = array.cast_into::<PyArrayDyn<f64>>()?;
        // A contiguous array of NumPy has at least one axis; a lone number has none.
        let shape: Vec<usize> = given.getattr("shape")?.extract()?;
        let values = array.to_vec().map_err(|_| no_numbers("of this layout"))?;
        debug_assert_eq!(array.len(), values.len());
        match values.iter().position(|value| !value.is_finite()) {
            Some(index) => Err(wrong(format!("{name}: number {index} is {}, must be finite", values[index]))),
            None => Ok(Numbers { shape, values }),
        }
    }

    /// The only numbers of an argument of `N` numbers.
    ///
    /// # Errors
    /// `ValueError` if their shape is another.
    pub fn exactly<const N: usize>(name: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; N]> {
        let numbers = Numbers::of(name, value)?;
        match (numbers.shape.as_slice(), numbers.values.try_into()) {
            ([_], Ok(values)) => Ok(values),
            (shape, _) => Err(wrong_shape(name, shape, &format!("({N},)"))),
        }
    }

    /// As points or vectors.
    ///
    /// # Errors
    /// `ValueError` if the shape is not `(N, 3)`.
    pub fn points(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<DVec3>> {
        let numbers = Numbers::of(name, value)?;
        match numbers.shape.as_slice() {
            [_, 3] => Ok(numbers.rows().collect()),
            shape => Err(wrong_shape(name, shape, "(N, 3)")),
        }
    }

    /// As a 3x3 matrix.
    ///
    /// # Errors
    /// `ValueError` if the shape is another.
    pub fn matrix(name: &str, value: &Bound<'_, PyAny>) -> PyResult<DMat3> {
        let numbers = Numbers::of(name, value)?;
        match (numbers.shape.as_slice(), numbers.values.try_into()) {
            ([3, 3], Ok(values)) => Ok(matrix_of_rows(values)),
            (shape, _) => Err(wrong_shape(name, shape, "(3, 3)")),
        }
    }

    /// Three numbers each.
    pub fn rows(&self) -> impl Iterator<Item = DVec3> {
        self.values.chunks_exact(3).map(DVec3::from_slice)
    }
}

/// A matrix from its numbers row by row.
pub fn matrix_of_rows(values: [f64; 9]) -> DMat3 {
    DMat3::from_cols_array(&values).transpose()
}

/// `ValueError` that says which shape was expected.
pub fn wrong_shape(name: &str, shape: &[usize], expected: &str) -> PyErr {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if lengths.len() == 1 { "," } else { "" };
    wrong(format!("{name}: has the shape ({}{comma}), must have {expected}", lengths.join(", ")))
}

/// Points as an array `(N, 3)` of float32.
pub fn point_array<'py>(
    py: Python<'py>,
    points: impl ExactSizeIterator<Item = DVec3>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let count = points.len();
    array(py, [count, 3], points.flat_map(|point| point.as_vec3().to_array()).collect())
}

/// Vectors as an array `(N, 3)` of float64.
pub fn vector_array<'py>(py: Python<'py>, vectors: &[DVec3]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    array(py, [vectors.len(), 3], vectors.iter().flat_map(DVec3::to_array).collect())
}

/// A matrix as an array of float64.
pub fn matrix_array<'py>(py: Python<'py>, matrix: &DMat3) -> Bound<'py, PyArray2<f64>> {
    Array2::from_shape_fn((3, 3), |(row, column)| matrix.col(column)[row]).into_pyarray(py)
}

/// Numbers, row-major, as an array that owns them.
pub fn array<'py, T: numpy::Element, D: Dimension, S: numpy::ndarray::IntoDimension<Dim = D>>(
    py: Python<'py>,
    shape: S,
    values: Vec<T>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let array = Array::from_shape_vec(shape.into_dimension(), values).map_err(|error| wrong(error.to_string()))?;
    Ok(array.into_pyarray(py))
}
