//! The limit on a process's address space, as set by `ulimit -v` and batch systems. Graphics drivers reserve a lot and
//! check little: under a low limit they report no adapter, fail to open a device or crash, without naming the cause.

use crate::device::DeviceError;

/// With less address space, no driver is tried, MiB. Mesa's lavapipe crashes at 400, does not open a device at 600, and
/// renders small pictures at 1000.
const LEAST_MIB: u64 = 1024;

/// The address space that this process can use, MiB, if it is limited.
pub fn address_space_limit_mib() -> Option<u64> {
    limit_mib(&std::fs::read_to_string("/proc/self/limits").ok()?)
}

/// The soft limit in the kernel's table of limits.
fn limit_mib(table: &str) -> Option<u64> {
    let row = table.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let bytes: u64 = row.split_whitespace().next()?.parse().ok()?;
    Some(bytes >> 20)
}

/// A hint for messages about missing memory or a missing adapter; empty if there is no limit.
pub(super) fn hint() -> String {
    address_space_limit_mib().map_or_else(String::new, |limit| {
        format!("; this process may use only {limit} MiB of address space (`ulimit -v`), which may be too little")
    })
}

/// Fails if a driver would have too little address space.
pub(super) fn check() -> Result<(), DeviceError> {
    match address_space_limit_mib() {
        Some(limit_mib) if limit_mib < LEAST_MIB => Err(DeviceError::MemoryLimit { limit_mib, least_mib: LEAST_MIB }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_read_from_the_kernels_table() {
        let table = |limit: &str| {
            format!(
                "Limit                     Soft Limit           Hard Limit           Units\nMax cpu time              unlimited            unlimited            seconds\nMax address space         {limit}            unlimited            bytes\n"
            )
        };
        assert_eq!(limit_mib(&table("1073741824")), Some(1024));
        assert_eq!(limit_mib(&table("unlimited")), None);
        assert_eq!(limit_mib(""), None);
    }
}
