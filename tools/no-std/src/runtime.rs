//! What std and libc would have given: the entry point, exit, an allocator, a panic handler and the memory functions
//! that the compiler calls on its own. Linux on x86-64 only.

use core::alloc::{GlobalAlloc, Layout};
use core::arch::{asm, naked_asm};
use core::cell::UnsafeCell;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicUsize, Ordering};

/// Bytes the proof may allocate in all: a hundred triangles and a few hundred rays need far less.
const HEAP: usize = 1 << 20;

/// Exit code of a panic, the one that std uses.
const PANICKED: i32 = 101;

/// Where the kernel jumps to.
// SAFETY: without libc nothing else has this name, and the linker wants it.
#[unsafe(no_mangle)]
// SAFETY: the assembly calls `start`, which does not return, on the stack that the kernel made.
#[unsafe(naked)]
extern "C" fn _start() -> ! {
    // A call, not a jump: the ABI wants the stack 16-byte aligned before the call pushes the return address.
    naked_asm!("xor ebp, ebp", "call {main}", "ud2", main = sym start)
}

extern "C" fn start() -> ! {
    exit(crate::main())
}

/// Ends the process.
pub fn exit(code: i32) -> ! {
    // SAFETY: system call 231 is exit_group; it takes one integer and does not return.
    unsafe { asm!("syscall", in("rax") 231, in("rdi") code, options(noreturn, nostack)) }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    exit(PANICKED)
}

/// Named by the unwind tables of the precompiled alloc; nothing unwinds here, so nothing calls it.
// SAFETY: without std nothing else has this name.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

/// Hands out memory from a fixed block and takes none back.
struct Bump {
    block: UnsafeCell<[u8; HEAP]>,
    used: AtomicUsize,
}

// SAFETY: the block is only reached through `alloc`, which hands out each byte once.
unsafe impl Sync for Bump {}

// SAFETY: a successful `fetch_update` gives the range `start..end` of the block, aligned and inside it, to this call
// alone.
unsafe impl GlobalAlloc for Bump {
    // SAFETY: returns null or a range that fits `layout`, of no size at all too, and that no other call was given.
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let base = self.block.get().cast::<u8>();
        let address = base as usize;
        let range = |used: usize| {
            let start = (address + used).checked_next_multiple_of(layout.align())? - address;
            let end = start.checked_add(layout.size())?;
            (end <= HEAP).then_some((start, end))
        };
        match self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |used| range(used).map(|(_, end)| end)) {
            Ok(before) => range(before).map_or(core::ptr::null_mut(), |(start, _)| base.wrapping_add(start)),
            Err(_) => core::ptr::null_mut(),
        }
    }

    // SAFETY: does nothing, so nothing is freed twice or in use.
    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}

#[global_allocator]
static HEAP_BLOCK: Bump = Bump { block: UnsafeCell::new([0; HEAP]), used: AtomicUsize::new(0) };

// The compiler turns copies into calls of these by name. Volatile accesses keep it from recognising the loops below as
// copies in their turn, which would make each function call itself for ever.

// SAFETY: the name, signature and meaning of the C library's function, which is not linked.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcpy(to: *mut u8, from: *const u8, bytes: usize) -> *mut u8 {
    for i in 0..bytes {
        // SAFETY: the caller owns `bytes` bytes at both places.
        unsafe { to.add(i).write_volatile(from.add(i).read_volatile()) }
    }
    to
}

// SAFETY: the name, signature and meaning of the C library's function, which is not linked.
#[unsafe(no_mangle)]
unsafe extern "C" fn memmove(to: *mut u8, from: *const u8, bytes: usize) -> *mut u8 {
    let copy = |i: usize| {
        // SAFETY: the caller owns `bytes` bytes at both places, and `i` is below `bytes`.
        unsafe { to.add(i).write_volatile(from.add(i).read_volatile()) }
    };
    if (to as usize) <= (from as usize) {
        (0..bytes).for_each(copy)
    } else {
        (0..bytes).rev().for_each(copy)
    }
    to
}

// SAFETY: the name, signature and meaning of the C library's function, which is not linked.
#[unsafe(no_mangle)]
unsafe extern "C" fn memset(to: *mut u8, byte: i32, bytes: usize) -> *mut u8 {
    for i in 0..bytes {
        // SAFETY: the caller owns `bytes` bytes.
        unsafe { to.add(i).write_volatile(byte as u8) }
    }
    to
}

// SAFETY: the name, signature and meaning of the C library's function, which is not linked.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcmp(a: *const u8, b: *const u8, bytes: usize) -> i32 {
    for i in 0..bytes {
        // SAFETY: the caller owns `bytes` bytes at both places.
        let (a, b) = unsafe { (a.add(i).read_volatile(), b.add(i).read_volatile()) };
        if a != b {
            return i32::from(a) - i32::from(b);
        }
    }
    0
}

// SAFETY: the name, signature and meaning of the C library's function, which is not linked.
#[unsafe(no_mangle)]
unsafe extern "C" fn bcmp(a: *const u8, b: *const u8, bytes: usize) -> i32 {
    // SAFETY: the caller owns `bytes` bytes at both places, which is all that `memcmp` asks.
    unsafe { memcmp(a, b, bytes) }
}
