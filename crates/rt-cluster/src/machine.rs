//! What a rank tells of where it runs.

use serde::{Deserialize, Serialize};
use std::fs;

/// Where a rank runs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Name of its machine.
    pub host: String,
    /// Bytes of the largest resident set that its process had so far, where the system tells.
    pub memory: Option<u64>,
}

impl Machine {
    /// Where this process runs.
    #[must_use]
    pub fn this() -> Self {
        Self { host: host(), memory: memory() }
    }
}

/// Name of this machine, for people.
#[must_use]
pub fn host() -> String {
    fs::read_to_string("/proc/sys/kernel/hostname").map_or_else(|_| "?".to_owned(), |name| name.trim().to_owned())
}

fn memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}
