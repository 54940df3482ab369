//! The control and status register of the SSE unit (Intel, *Software Developer's Manual*, volume 1, 10.2.3).
#![expect(unsafe_code, reason = "the register is reached by two instructions only")]

use core::arch::asm;

/// Bits 0 to 5: exceptions that have happened. They are the caller's to read, and are left alone.
const FLAGS: u32 = 0x3f;

/// The rest: how to round, what becomes of subnormal numbers, what traps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Control(pub(crate) u32);

impl Control {
    /// Rounds to nearest, keeps subnormal numbers, traps nothing: what a program begins with, and what Rust assumes.
    pub(crate) const DEFAULT: Self = Self(0x1f80);
}

/// Sets the control bits and returns what they were. Not inlined: arithmetic of the caller's must not be moved across.
#[inline(never)]
pub(crate) fn exchange(control: Control) -> Control {
    let before = read();
    if before & !FLAGS != control.0 {
        write((before & FLAGS) | control.0);
    }
    Control(before & !FLAGS)
}

fn read() -> u32 {
    let mut word = 0_u32;
    // SAFETY: `stmxcsr` writes four bytes to its operand, which is a valid and aligned `u32`, and nothing else.
    unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut word, options(nostack, preserves_flags)) };
    word
}

fn write(word: u32) {
    // SAFETY: `ldmxcsr` reads four bytes from its operand, which is a valid and aligned `u32`. It faults on reserved
    // bits only, and what is written is either `Control::DEFAULT` or was read from the register, so it has none. With
    // the default the program is as Rust assumes it; with another word it is as the caller had made it before, under
    // whose responsibility that was.
    unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const word, options(nostack, readonly)) };
}
