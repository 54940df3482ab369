//! What launches cost beside their tasks, found from what they took.

use core::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// How many standard deviations what is found may be wrong, without a unit.
const DOUBT: f64 = 2.0;

/// Relative difference below which sizes of launches are the same.
const ALIKE: f64 = 1e-6;

/// A number that is kept as its bits.
pub(super) fn get(bits: &AtomicU64) -> f64 {
    f64::from_bits(bits.load(Relaxed))
}

/// What launches of a device took, from which follows what each costs beside its tasks: of `x`, one over the share of
/// the stream that a launch was, and `y`, its seconds for each share, their sums and those of their products.
///
/// A launch of share `s` takes `a + b·s` seconds, so `y = b + a·x`: a straight line. What tasks deviate by is then the
/// same for short launches and for long ones, since a short launch's tasks are neighbours and alike.
#[derive(Debug)]
pub(super) struct Timed {
    sums: [AtomicU64; 5],
    /// Seconds of the shortest launch, which are no less than what it cost beside its tasks.
    least: AtomicU64,
}

impl Default for Timed {
    fn default() -> Self {
        Self { sums: Default::default(), least: AtomicU64::new(f64::INFINITY.to_bits()) }
    }
}

impl Timed {
    /// Adds a launch of a share of the stream.
    pub(super) fn add(&self, share: f64, seconds: f64) {
        let (x, y) = (1.0 / share, seconds / share);
        for (sum, term) in self.sums.iter().zip([1.0, x, y, x * x, x * y]) {
            sum.store((get(sum) + term).to_bits(), Relaxed);
        }
        self.least.fetch_min(seconds.to_bits(), Relaxed);
    }

    /// The share of the stream that the device could do while it is busy with a launch beside its tasks, if these
    /// deviate by `noise` about their mean: the least of what is likely, since one launch too few costs more than one
    /// too many.
    pub(super) fn price(&self, noise: f64) -> f64 {
        let [n, x, y, xx, xy] = self.sums.each_ref().map(get);
        let spread = xx - x * x / n;
        // Too few launches, or all of one size.
        if n < 3.0 || spread <= ALIKE * xx {
            return 0.0;
        }
        let a = (xy - x * y / n) / spread;
        let b = (y - a * x) / n;
        if b > 0.0 { (a / b - DOUBT * noise / libm::sqrt(spread)).clamp(0.0, get(&self.least) / b) } else { 0.0 }
    }
}
