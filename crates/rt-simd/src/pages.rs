//! Trees in large pages of memory.
//!
//! Rays that go any way touch a page or more with every node that they visit, and the places of small pages are soon
//! more than a processor remembers: it then waits for those as well. Linux has large pages for whoever asks, and many
//! systems give none unasked.
#![cfg_attr(
    all(target_os = "linux", target_env = "gnu"),
    expect(unsafe_code, reason = "the call that asks for large pages is one of the C library")
)]

use rt_bvh::BlockTree;

/// Asks the system to move a tree into large pages, which takes about as long as copying it once. Where the system has
/// none, or cannot be asked, the tree stays as it is.
pub fn use_large_pages(tree: &BlockTree) {
    enlarge(bytemuck::cast_slice(tree.nodes()));
    enlarge(bytemuck::cast_slice(tree.blocks()));
}

/// Moves what of it fills whole large pages.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn enlarge(bytes: &[u8]) {
    /// Of 64-bit processors with pages of 4 KiB. Others refuse what is not a whole number of their own.
    const LARGE: usize = 1 << 21;
    let whole = bytes.get(bytes.as_ptr().align_offset(LARGE)..).unwrap_or_default();
    let whole = &whole[..whole.len() / LARGE * LARGE];
    if !whole.is_empty() {
        // SAFETY: the addresses are those of a borrowed slice; it keeps them, and what it holds. What the call answers
        // changes nothing.
        unsafe { libc::madvise(whole.as_ptr().cast_mut().cast(), whole.len(), libc::MADV_COLLAPSE) };
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn enlarge(_: &[u8]) {}
