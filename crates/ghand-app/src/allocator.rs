//! The allocator of the programs.

/// Training makes and drops tensors of megabytes in every step, which the system's allocator takes from the system
/// and gives back each time: a quarter of the networks' forward pass on Linux.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;
