//! The process's heap.

/// Gives free memory back to the system.
///
/// A device, its driver and its compiled shaders are many allocations of many threads. When they are freed, glibc keeps
/// their pages in an arena for each thread, and the next device's threads use other arenas: a process that opens devices
/// again and again grows, although nothing is leaked.
pub fn give_back_free_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    #[allow(unsafe_code, reason = "the standard library does not expose its allocator")]
    // SAFETY: takes the allocator's own locks, and changes nothing that is in use.
    unsafe {
        libc::malloc_trim(0);
    }
}
