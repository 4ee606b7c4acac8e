//! Prints a last sentence when the process is about to crash.
//!
//! Graphics drivers are C libraries inside the process. If memory is short they may dereference a null pointer or
//! abort, and Rust's own allocator also aborts. Without this module a user would see only `Segmentation fault`.

#[cfg(target_os = "linux")]
pub use linux::explain_crashes;

/// Other systems report crashes themselves.
#[cfg(not(target_os = "linux"))]
pub fn explain_crashes() {}

#[cfg(target_os = "linux")]
mod linux {
    use std::sync::OnceLock;

    use ghand_render::address_space_limit_mib;

    struct Crash {
        sentence: String,
        /// Whether the process ends with exit code 1 instead of the signal, which leaves a core dump.
        is_expected: bool,
        /// The previous signal handlers: Rust's check for stack overflows.
        before: Vec<(libc::c_int, libc::sigaction)>,
    }

    static CRASH: OnceLock<Crash> = OnceLock::new();

    const SIGNALS: [libc::c_int; 3] = [libc::SIGSEGV, libc::SIGBUS, libc::SIGABRT];

    /// From now on a crash is explained on stderr. With a limit on the address space, a crash is a failed allocation
    /// and ends the process with exit code 1; otherwise the crash continues after the sentence.
    pub fn explain_crashes() {
        let limit = address_space_limit_mib();
        let sentence = match limit {
            Some(limit) => format!(
                "\nerror: not enough memory: this process may use only {limit} MiB of address space (`ulimit -v`); \
                 raise the limit, or use smaller pictures or fewer Gaussians\n"
            ),
            None => "\nerror: the program crashed, perhaps in a graphics driver or for lack of memory; use smaller \
                     pictures or fewer Gaussians, update the driver, or choose another adapter with GHAND_ADAPTER (`cpu` \
                     runs anywhere)\n"
                .to_owned(),
        };
        let before = SIGNALS.into_iter().filter_map(|signal| Some((signal, handler_of(signal)?))).collect();
        if CRASH.set(Crash { sentence, is_expected: limit.is_some(), before }).is_ok() {
            SIGNALS.into_iter().for_each(install);
        }
    }

    #[allow(unsafe_code, reason = "the standard library cannot handle signals")]
    fn handler_of(signal: libc::c_int) -> Option<libc::sigaction> {
        // SAFETY: all zeros are a valid `sigaction`, and a null pointer for the new action only queries the present
        // one.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            (libc::sigaction(signal, std::ptr::null(), &raw mut action) == 0).then_some(action)
        }
    }

    #[allow(unsafe_code, reason = "the standard library cannot handle signals")]
    fn install(signal: libc::c_int) {
        // SAFETY: `on_crash` calls only functions that a signal handler may call.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = on_crash as *const () as usize;
            // On its own stack, because the crash may be an overflow of the thread's.
            action.sa_flags = libc::SA_ONSTACK;
            libc::sigaction(signal, &raw const action, std::ptr::null_mut());
        }
    }

    #[allow(unsafe_code, reason = "the standard library cannot handle signals")]
    extern "C" fn on_crash(signal: libc::c_int) {
        let Some(crash) = CRASH.get() else { return };
        // SAFETY: `write`, `_exit`, `sigaction` and `raise` may be called in a signal handler; the sentence lives as
        // long as the process.
        unsafe {
            libc::write(libc::STDERR_FILENO, crash.sentence.as_ptr().cast(), crash.sentence.len());
            if crash.is_expected {
                libc::_exit(1);
            }
            // Restores the previous handlers; the crashing instruction runs again and triggers them. `abort` raises its
            // signal again by itself.
            if let Some((_, before)) = crash.before.iter().find(|(s, _)| *s == signal) {
                libc::sigaction(signal, before, std::ptr::null_mut());
            }
        }
    }
}
