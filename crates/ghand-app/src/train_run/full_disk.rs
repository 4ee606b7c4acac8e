//! Writing to a disk that may be full.

use std::io::{self, ErrorKind};
use std::path::Path;
use std::time::Duration;

use crate::train_run::interruption::Interruption;

/// Time between two attempts.
const PAUSE: Duration = Duration::from_secs(2);

/// Repeats `write` while the disk is full: what took hours to train is not thrown away because a file of a few megabytes
/// finds no room. `path` is for the message. A signal ends the wait and the program; a host's wish, the wait.
///
/// # Errors
/// The error of `write` if it fails for any other reason, or once a host wants an end.
pub fn when_there_is_room<T>(
    path: &Path,
    interruption: &Interruption,
    mut write: impl FnMut() -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let mut told = false;
    loop {
        match write() {
            Err(error) if is_full(&error) => {
                if !told {
                    log::warn!("{}: there is no room on the disk; waiting until there is", path.display());
                    interruption.end_with(format!("stopped: {} found no room on the disk", path.display()));
                    told = true;
                }
                if interruption.ends() {
                    return Err(error);
                }
                std::thread::sleep(PAUSE);
            }
            result => return result,
        }
    }
}

fn is_full(error: &anyhow::Error) -> bool {
    let kind = |cause: &(dyn std::error::Error + 'static)| cause.downcast_ref::<io::Error>().map(io::Error::kind);
    let full = [ErrorKind::StorageFull, ErrorKind::QuotaExceeded];
    error.chain().filter_map(kind).any(|kind| full.contains(&kind))
}

#[cfg(test)]
mod tests {
    use anyhow::Context;

    use super::*;

    #[test]
    fn only_a_full_disk_is_waited_for() {
        let mut attempts = 0;
        let interruption = Interruption::listen("stopped").unwrap();
        let result = when_there_is_room(Path::new("a"), &interruption, || {
            attempts += 1;
            match attempts {
                1 => Err(io::Error::from(ErrorKind::StorageFull)).context("a: cannot write"),
                2 => Err(io::Error::from(ErrorKind::PermissionDenied)).context("a: cannot write"),
                _ => Ok(()),
            }
        });
        assert_eq!(attempts, 2);
        assert!(result.is_err());
    }
}
