//! Memory as the system sees it: what is free, and what this process took at its peak.

/// Memory assumed where the system does not say what is free.
const UNKNOWN_FREE_BYTES: u64 = 4 << 30;

/// Bytes of memory that are free.
pub(crate) fn free_bytes() -> u64 {
    status_kib("/proc/meminfo", "MemAvailable:").map_or(UNKNOWN_FREE_BYTES, |kib| kib << 10)
}

/// Peak resident set of this process in bytes, mapped pages included; `None` where the system does not say.
pub(crate) fn peak_resident_bytes() -> Option<u64> {
    status_kib("/proc/self/status", "VmHWM:").map(|kib| kib << 10)
}

fn status_kib(path: &str, field: &str) -> Option<u64> {
    let text = fs_err::read_to_string(path).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(field))?;
    line.split_whitespace().next()?.parse().ok()
}
