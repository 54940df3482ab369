//! What is left to visit.

/// Most entries: seven for each node of a path but the last, and eight for that; the deepest two-wide tree has 128
/// levels, and a leaf of as many triangles as there can be adds eleven to an eight-wide one.
const ENTRIES: usize = 1024;

/// A stack of children, each with the least distance at which its box is entered, and the rays that may enter it.
#[derive(Clone, Debug)]
pub(crate) struct Stack {
    entries: Box<[f32; ENTRIES + 8]>,
    children: Box<[u32; ENTRIES + 8]>,
    rays: Box<[u64; ENTRIES + 8]>,
    used: usize,
}

impl Stack {
    /// Places of entries.
    pub(crate) const PLACES: usize = ENTRIES;

    /// Deepest tree whose traversals it can hold.
    pub(crate) const DEPTH: u32 = ((ENTRIES - 8) / 7) as u32;

    pub(crate) fn new() -> Self {
        Self {
            entries: Box::new([0.0; ENTRIES + 8]),
            children: Box::new([0; ENTRIES + 8]),
            rays: Box::new([0; ENTRIES + 8]),
            used: 0,
        }
    }

    #[inline(always)]
    pub(crate) const fn len(&self) -> usize {
        self.used
    }

    /// Takes away all but so many.
    #[inline(always)]
    pub(crate) const fn cut(&mut self, used: usize) {
        self.used = used;
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, entry: f32, child: u32, rays: u64) {
        let top = self.used & (ENTRIES - 1);
        (self.entries[top], self.children[top], self.rays[top]) = (entry, child, rays);
        self.used = top + 1;
    }

    /// The same on a condition, without a branch.
    #[inline(always)]
    pub(crate) fn push_if(&mut self, condition: bool, entry: f32, child: u32, rays: u64) {
        let top = self.used & (ENTRIES - 1);
        (self.entries[top], self.children[top], self.rays[top]) = (entry, child, rays);
        self.used = top + usize::from(condition);
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> (f32, u32, u64) {
        let top = self.used.wrapping_sub(1) & (ENTRIES - 1);
        self.used = top;
        (self.entries[top], self.children[top], self.rays[top])
    }

    /// The uppermost children, as many as there must be.
    #[inline(always)]
    pub(crate) fn next(&self, count: usize) -> &[u32] {
        &self.children[self.used.saturating_sub(count)..self.used.min(ENTRIES)]
    }

    /// Where the next eight distances and children go, of which [`Stack::grow`] keeps some.
    #[inline(always)]
    pub(crate) fn room(&mut self) -> (&mut [f32; 8], &mut [u32; 8]) {
        let top = self.used & (ENTRIES - 1);
        // There is always room for eight behind the top.
        match (self.entries[top..].first_chunk_mut(), self.children[top..].first_chunk_mut()) {
            (Some(entries), Some(children)) => (entries, children),
            _ => unreachable!("the stack has eight more entries than it uses"),
        }
    }

    #[inline(always)]
    pub(crate) const fn grow(&mut self, count: usize) {
        self.used += count;
    }
}
