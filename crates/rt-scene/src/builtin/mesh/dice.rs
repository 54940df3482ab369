//! Random numbers for what grows and is laid by hand.

use glam::Vec3;

/// A stream of random numbers, a function of its seed alone.
#[derive(Clone, Debug)]
pub(in crate::builtin) struct Dice {
    seed: u32,
    thrown: u32,
}

impl Dice {
    /// The stream of `seed`.
    pub(in crate::builtin) const fn new(seed: u32) -> Self {
        Self { seed, thrown: 0 }
    }

    /// A number between `low` and `high`.
    pub(in crate::builtin) fn between(&mut self, low: f32, high: f32) -> f32 {
        self.thrown += 1;
        low + (high - low) * rt_core::random::pair(self.seed, self.thrown, 0)[0]
    }

    /// One of several, all as likely.
    pub(in crate::builtin) fn pick<T: Copy, const N: usize>(&mut self, of: [T; N]) -> T {
        self.thrown += 1;
        of[rt_core::random::below(N as u32, self.seed, self.thrown, 0) as usize]
    }

    /// A point inside the unit sphere, by rejection.
    pub(in crate::builtin) fn in_ball(&mut self) -> Vec3 {
        loop {
            let p = Vec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }
}
