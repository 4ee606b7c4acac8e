//! What is open: the subject and where it is from, the run that trains it, and the capture beside it.

pub mod capture_panel;
pub mod capture_poses;
pub mod file_reader;
pub mod scene;
pub mod subject;
pub mod training_run;
pub mod watched_file;
