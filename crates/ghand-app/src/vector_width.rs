//! The width of a software rasteriser's vectors.
//!
//! Mesa's computes with 256 bits unless it is told otherwise. With the 512 bits of AVX-512 frames and training are faster
//! (`docs/benchmarks.md`).

/// Mesa's variable, bits.
const VARIABLE: &str = "LP_NATIVE_VECTOR_WIDTH";

/// Asks Mesa for the widest vectors of this processor, unless the user has chosen a width.
///
/// Must be called first in `main`, before any other thread exists.
pub fn choose() {
    if std::env::var_os(VARIABLE).is_none() && has_avx512() {
        set("512");
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

#[cfg(not(target_arch = "x86_64"))]
fn has_avx512() -> bool {
    false
}

#[allow(unsafe_code, reason = "the environment is what the driver, a C library, reads")]
fn set(bits: &str) {
    // SAFETY: no other thread exists yet that could read the environment meanwhile; see `choose`.
    unsafe { std::env::set_var(VARIABLE, bits) }
}
