//! How long a thread worked.

use std::time::Duration;

/// Measures the processor time of the calling thread: unlike wall time it does not count the milliseconds for which the
/// system ran something else, which on a shared machine would make cheap tasks look expensive. Wall time where the
/// system does not tell.
#[derive(Debug)]
pub(crate) struct Stopwatch(Duration);

impl Stopwatch {
    pub(crate) fn start() -> Self {
        Self(now())
    }

    /// Seconds since the start. Must be called on the thread that started it.
    pub(crate) fn seconds(&self) -> f32 {
        now().saturating_sub(self.0).as_secs_f32()
    }
}

#[cfg(unix)]
fn now() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    // Neither is negative: the clock counts up from 0.
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
}

#[cfg(not(unix))]
fn now() -> Duration {
    static ORIGIN: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    ORIGIN.get_or_init(std::time::Instant::now).elapsed()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleeping_is_not_work() {
        let watch = Stopwatch::start();
        std::thread::sleep(Duration::from_millis(50));
        assert!(cfg!(not(unix)) || watch.seconds() < 0.04);
        while watch.seconds() < 0.001 {}
    }
}
