//! What all devices do together.

use super::timed::get;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};

/// All devices together, as they were found a moment ago.
///
/// They are looked at anew after every [`OFTEN`]th part of as many calls as there are devices, so that a call takes the
/// same time however many there are.
#[derive(Debug, Default)]
pub(super) struct Overview {
    calls: AtomicUsize,
    /// The sum of all speeds, as the bits of an `f64`, and so the two greatest.
    speed: AtomicU64,
    fastest: [AtomicU64; 2],
    /// Who is fastest.
    first: AtomicUsize,
}

const OFTEN: usize = 32;

impl Overview {
    /// Looks at so many devices, those that are not lost with their speeds, if it is time to.
    pub(super) fn look(&self, count: usize, living: impl Iterator<Item = (usize, f64)>) {
        let Self { calls, speed, fastest, first } = self;
        if calls.fetch_add(1, Relaxed) % (count / OFTEN).max(1) != 0 {
            return;
        }
        let (mut sum, mut most, mut second, mut who) = (0.0, 0.0, 0.0, 0);
        for (device, found) in living {
            sum += found;
            if found > most {
                (most, second, who) = (found, most, device);
            } else if found > second {
                second = found;
            }
        }
        speed.store(f64::to_bits(sum), Relaxed);
        first.store(who, Relaxed);
        fastest[0].store(f64::to_bits(most), Relaxed);
        fastest[1].store(f64::to_bits(second), Relaxed);
    }

    /// The speed of all, in streams per second.
    pub(super) fn speed(&self) -> f64 {
        get(&self.speed)
    }

    /// The greatest speed of the others.
    pub(super) fn fastest_other(&self, device: usize) -> f64 {
        let own = self.first.load(Relaxed) == device;
        get(&self.fastest[usize::from(own)])
    }
}
