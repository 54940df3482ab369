//! How long a thread worked.

use std::time::{Duration, Instant};

/// Measures the processor time of the calling thread, piece of work by piece: unlike wall time it does not count the
/// milliseconds for which the system ran something else, which on a shared machine would make cheap tasks look
/// expensive. Wall time where the system does not tell.
///
/// Asking the system takes up to half a microsecond, 4% of the fastest tasks. So it is asked only about pieces so long
/// that something else may have run meanwhile: the wall time of others is theirs.
#[derive(Debug)]
pub(crate) struct Stopwatch {
    /// When the last piece ended.
    last: Instant,
    /// What the system said when it was last asked, and the time of the pieces since then.
    said: Duration,
    since: Duration,
}

/// Systems seldom let a thread wait for less.
const SHORT: Duration = Duration::from_micros(500);

impl Stopwatch {
    /// Of the calling thread, which is the only one to use it.
    pub(crate) fn start() -> Self {
        Self { last: Instant::now(), said: said(), since: Duration::ZERO }
    }

    /// Seconds of work since the last call, or since the start.
    pub(crate) fn lap(&mut self) -> f32 {
        let now = Instant::now();
        let mut took = now.saturating_duration_since(self.last);
        self.last = now;
        if took < SHORT {
            self.since += took;
        } else {
            let now = said();
            took = now.saturating_sub(self.said).saturating_sub(self.since);
            (self.said, self.since) = (now, Duration::ZERO);
        }
        took.as_secs_f32()
    }
}

#[cfg(unix)]
fn said() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    // Neither is negative: the clock counts up from 0.
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
}

#[cfg(not(unix))]
fn said() -> Duration {
    static ORIGIN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    ORIGIN.get_or_init(Instant::now).elapsed()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn work(time: Duration) {
        let begin = said();
        while said() < begin + time {}
    }

    /// Mutants: wall time of long pieces; the pieces before are part of a long one; a piece begins with the first.
    #[test]
    fn sleeping_is_not_work_and_every_piece_has_its_own() {
        let mut watch = Stopwatch::start();
        std::thread::sleep(Duration::from_millis(50));
        assert!(cfg!(not(unix)) || watch.lap() < 0.04);
        let begin = said();
        let mut all = 0.0;
        for _ in 0..200 {
            work(Duration::from_micros(20));
            all += watch.lap();
        }
        work(Duration::from_millis(2));
        let long = watch.lap();
        assert!(cfg!(not(unix)) || long < 0.004, "{long}");
        // Others may have run during short pieces, whose time is then too long; none is lost.
        let worked = (said() - begin).as_secs_f32();
        assert!(all + long > 0.9 * worked, "{all} {long} {worked}");
    }
}
