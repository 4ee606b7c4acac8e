//! The process's heaps: ours, and that of graphics drivers.

/// Training makes and drops tensors of megabytes in every step, which the system's allocator takes from the system
/// and gives back each time: a quarter of the networks' forward pass on Linux.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Keeps the heap of C libraries, such as drivers, in one piece for all threads from now on, with glibc; elsewhere it
/// changes nothing. To be called before threads begin.
///
/// By default glibc gives each thread an arena of its own, up to eight for each core. A graphics device with its compiled
/// shaders is many allocations of many short-lived threads, and what remains of one keeps pages of every arena: a program
/// that opens devices again and again, for a lost one, for films and for small pictures, would grow by megabytes with each,
/// although nothing is leaked.
pub fn use_one_arena() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    #[allow(unsafe_code, reason = "the standard library does not expose its allocator")]
    // SAFETY: takes the allocator's own locks, and changes nothing that is in use. An option that is refused has no effect.
    unsafe {
        libc::mallopt(libc::M_ARENA_MAX, 1);
    }
}
