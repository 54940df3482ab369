//! The floating-point environment that hits are defined in: rounding to nearest, subnormal numbers kept, no traps.
//!
//! A host program may have set another one: audio and game code flushes subnormal numbers to zero, interval arithmetic
//! rounds upwards, debuggers of numerics trap. Threads inherit it from whoever starts them. Hits would then have other
//! bits, boxes would no longer hold what is in them, and Rust itself assumes the default. So everything that computes
//! for a caller does it inside of an [`Environment`].
//!
//! Current state and limits: x86-64, the control word of its SSE unit, which does all arithmetic there. On other
//! processors nothing is done.
#![no_std]
#![deny(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod mxcsr;
#[cfg(feature = "test-support")]
pub mod test_support;

use core::marker::PhantomData;

/// The default environment, on this thread, until it is dropped; then the caller's own is back.
///
/// Compilers know nothing of it: arithmetic in the same function whose operands and results stay in registers may be
/// moved to before or behind it. What is loaded from memory or stored there is not. So it belongs around calls, not
/// single operations.
#[derive(Debug)]
#[must_use = "the environment lasts as long as this does"]
pub struct Environment {
    #[cfg(target_arch = "x86_64")]
    before: mxcsr::Control,
    /// A thread's own.
    not_send: PhantomData<*const ()>,
}

impl Environment {
    /// Enters the default environment.
    pub fn enter() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            before: mxcsr::exchange(mxcsr::Control::DEFAULT),
            not_send: PhantomData,
        }
    }
}

impl Drop for Environment {
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        let _ = mxcsr::exchange(self.before);
    }
}

/// Enters the default environment for the rest of this thread's life.
pub fn settle_thread() {
    core::mem::forget(Environment::enter());
}

#[cfg(all(test, target_arch = "x86_64", feature = "test-support"))]
mod tests {
    use super::test_support::{ALL, with};
    use super::*;
    use core::hint::black_box;

    /// What tells environments apart: a third rounded, a subnormal result, and a subnormal operand.
    ///
    /// Through memory at both ends, and in a function of its own: see [`Environment`].
    #[inline(never)]
    fn fingerprint() -> [u32; 3] {
        let tiny = f32::from_bits(1);
        // Rounded upwards and downwards, to nearest; away from 0 both.
        let thirds = [black_box(1.0_f32) / black_box(3.0), black_box(-1.0_f32) / black_box(3.0)];
        black_box([
            thirds.map(f32::to_bits).into_iter().fold(0, |sum, bits| sum.wrapping_mul(31).wrapping_add(bits)),
            (black_box(f32::MIN_POSITIVE) * black_box(0.5)).to_bits(),
            (black_box(tiny) * black_box(8_388_608.0)).to_bits(),
        ])
    }

    /// Mutants: the control word is not written; it is not put back; flags of exceptions are taken for controls.
    #[test]
    fn the_default_is_inside_and_the_callers_own_is_back_outside() {
        let right = fingerprint();
        for other in ALL {
            let (before, inside, after) = with(other, || {
                let before = fingerprint();
                let inside = {
                    let _environment = Environment::enter();
                    fingerprint()
                };
                (before, inside, fingerprint())
            });
            assert_ne!(before, right, "{other:?} makes no difference");
            assert_eq!((inside, after), (right, before), "{other:?}");
        }
        assert_eq!(fingerprint(), right);
    }

    #[test]
    fn a_panic_puts_it_back() {
        extern crate std;
        let right = fingerprint();
        let panic = std::panic::catch_unwind(|| with(ALL[0], || panic!("inside")));
        assert!(panic.is_err());
        assert_eq!(fingerprint(), right);
    }
}
