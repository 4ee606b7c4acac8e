//! MANO files of all layouts are read to the last bit, and damaged ones are rejected with a clear sentence.

mod hostile;
mod layouts;
mod left;
mod python_files;
