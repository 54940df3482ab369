//! What was measured on.

use rt_balance::cpu::CpuDevice;
use serde::Serialize;
use std::fmt;

/// The machine and the program, as far as timings depend on them.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// The processor's own name; empty where the system does not tell.
    pub processor: String,
    /// Hardware threads that this process may use.
    pub cores: usize,
    /// Operating system and instruction set.
    pub system: String,
    /// Version of raybalance.
    pub version: &'static str,
    /// `release` or `debug`: timings of the latter mean nothing.
    pub build: &'static str,
}

impl Machine {
    /// This machine.
    #[must_use]
    pub fn this() -> Self {
        // Linux only; elsewhere the name stays empty.
        let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let field =
            |line: &str| line.strip_prefix("model name")?.split_once(':').map(|(_, name)| name.trim().to_owned());
        Self {
            processor: info.lines().find_map(field).unwrap_or_default(),
            cores: CpuDevice::cores(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            version: env!("CARGO_PKG_VERSION"),
            build: if cfg!(debug_assertions) { "debug" } else { "release" },
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let processor = if self.processor.is_empty() { "unnamed processor" } else { &self.processor };
        let threads = if self.cores == 1 { "thread" } else { "threads" };
        write!(
            f,
            "{processor}, {} {threads}, {}, raybalance {} ({} build)",
            self.cores, self.system, self.version, self.build
        )
    }
}
