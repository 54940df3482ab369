//! Other environments, as a host program may have set them.

/// An environment that is not the default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strange {
    /// Subnormal results and operands are zero.
    FlushToZero,
    /// Rounds towards +∞.
    Up,
    /// Rounds towards −∞.
    Down,
    /// Rounds towards 0.
    Truncate,
}

/// All of them.
pub const ALL: [Strange; 4] = [Strange::FlushToZero, Strange::Up, Strange::Down, Strange::Truncate];

/// Runs `work` in a strange environment. Does nothing strange on processors other than x86-64.
pub fn with<R>(strange: Strange, work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    let _before = Restore(crate::mxcsr::exchange(strange.control()));
    let _ = strange;
    work()
}

#[cfg(target_arch = "x86_64")]
impl Strange {
    const fn control(self) -> crate::mxcsr::Control {
        let bits = match self {
            Self::FlushToZero => (1 << 15) | (1 << 6),
            Self::Up => 0b10 << 13,
            Self::Down => 0b01 << 13,
            Self::Truncate => 0b11 << 13,
        };
        crate::mxcsr::Control(crate::mxcsr::Control::DEFAULT.0 | bits)
    }
}

#[cfg(target_arch = "x86_64")]
struct Restore(crate::mxcsr::Control);

#[cfg(target_arch = "x86_64")]
impl Drop for Restore {
    fn drop(&mut self) {
        let _ = crate::mxcsr::exchange(self.0);
    }
}
