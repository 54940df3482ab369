//! The least of many loads, one of which grows at a time.

use alloc::vec::Vec;

/// Packed loads, one per device, of which the least is wanted again and again.
pub(super) trait Loads {
    /// The least word.
    fn first(&self) -> u64;
    /// The word of a device, which is the position it was made at.
    fn of(&self, device: usize) -> u64;
    /// Replaces the least word, that of `device`, by a greater one.
    fn replace_first(&mut self, device: usize, word: u64);
}

/// Up to this many devices, keeping the loads sorted in registers is faster than a tree in memory.
pub(super) const FEW: usize = 8;

/// A few loads in increasing order.
pub(super) struct SortedLoads {
    words: [u64; FEW],
    bits: u32,
}

impl SortedLoads {
    pub(super) fn new(words: &[u64], bits: u32) -> Self {
        let mut sorted = [u64::MAX; FEW];
        sorted[..words.len()].copy_from_slice(words);
        Self { words: sorted, bits }
    }
}

impl Loads for SortedLoads {
    fn first(&self) -> u64 {
        self.words[0]
    }

    fn of(&self, device: usize) -> u64 {
        let mask = (1 << self.bits) - 1;
        self.words.iter().copied().find(|word| word & mask == device as u64 && *word != u64::MAX).unwrap_or(0)
    }

    /// One step of insertion sort without a branch: all words move at once.
    #[inline]
    fn replace_first(&mut self, _: usize, word: u64) {
        let old = self.words;
        self.words[0] = old[1].min(word);
        for i in 1..FEW - 1 {
            self.words[i] = old[i + 1].min(word).max(old[i]);
        }
        self.words[FEW - 1] = old[FEW - 1].max(word);
    }
}

/// The least of a set of words that change one at a time: a complete tree of minima (D. Knuth, *The Art of Computer
/// Programming* 3, 5.4.1, "tree of winners"), four children to a node.
///
/// The siblings on a leaf's way up do not depend on one another, so a change costs a chain of one minimum per level,
/// without a branch; four children halve the levels of two.
pub(super) struct WinnerTree {
    /// The leaves, then each level's minima, the root last; absent words are `u64::MAX`.
    nodes: Vec<u64>,
    /// Number of leaves, a power of four.
    width: usize,
}

impl WinnerTree {
    pub(super) fn new(words: &[u64]) -> Self {
        let mut width = 1;
        while width < words.len() {
            width *= 4;
        }
        let mut nodes = words.to_vec();
        nodes.resize(width, u64::MAX);
        let mut level = 0..width;
        while level.len() > 1 {
            let minima: Vec<u64> =
                nodes[level.clone()].chunks(4).map(|c| c.iter().copied().fold(u64::MAX, u64::min)).collect();
            level = level.end..level.end + minima.len();
            nodes.extend(minima);
        }
        Self { nodes, width }
    }
}

impl Loads for WinnerTree {
    fn first(&self) -> u64 {
        self.nodes[self.nodes.len() - 1]
    }

    fn of(&self, leaf: usize) -> u64 {
        self.nodes[leaf]
    }

    #[inline]
    fn replace_first(&mut self, leaf: usize, word: u64) {
        let (mut start, mut width, mut at, mut least) = (0, self.width, leaf, word);
        while width > 1 {
            self.nodes[start + at] = least;
            let others = [1, 2, 3].map(|sibling| self.nodes[start + (at ^ sibling)]);
            least = least.min(others[0].min(others[1]).min(others[2]));
            start += width;
            width /= 4;
            at /= 4;
        }
        self.nodes[start] = least;
    }
}
