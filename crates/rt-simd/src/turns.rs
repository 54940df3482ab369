//! Single rays of a packet in turns: while one waits for what it visits next to come from memory, others go on.
//!
//! Packets of scattered rays leave most of their work to single rays, and each step of those reads a node or a block
//! that nobody has read for long. So rays do not go at once: what they are to visit is kept until it is much, and then
//! several go, one step each, and ask for what their next step reads. With rays that start anywhere that takes seven
//! tenths of the time (docs/results/cpu.md).

use crate::lanes::{LANES, Level};
use crate::packet::{GROUPS, RAYS, fetch};
use crate::rays::{Frame, Group};
use crate::single::Single;
use crate::stack::Stack;
use rt_bvh::BlockTree;
use rt_core::Ray;
use rt_core::intersect::Shear;

/// Rays that take turns. Measured: 4 to 16 are alike.
const ABREAST: usize = 8;

/// Visits after which rays go: kept longer, they find later that what a packet visits meanwhile is beyond their hits.
/// Measured: 8 to 128 are alike.
const ENOUGH: usize = 32;

/// Most visits that are kept: one more for each ray of a packet than [`ENOUGH`].
const MOST: usize = 128;
const _: () = assert!(ENOUGH + RAYS <= MOST);

/// Stands for no visit.
const NONE: u8 = u8::MAX;

/// What rays are to visit.
#[derive(Clone, Debug)]
pub(crate) struct Turns {
    visits: [Visit; MOST],
    kept: usize,
    /// For each ray of the packet that has visits, its first and its last one.
    first: [u8; RAYS],
    last: [u8; RAYS],
    /// Those rays.
    waiting: u64,
    going: Vec<Going>,
}

/// A child, the least distance at which its box is entered, and what the ray is to visit next.
#[derive(Clone, Copy, Debug)]
struct Visit {
    entry: f32,
    child: u32,
    next: u8,
}

/// A ray on its way.
#[derive(Clone, Debug)]
struct Going {
    ray: Single,
    /// Which of the packet it is.
    number: usize,
    axes: [usize; 3],
    /// Made when the first triangle asks for it.
    shear: Option<Shear>,
    /// What hangs below the present visit.
    stack: Stack,
    /// The visit after it.
    next: u8,
}

/// The packet whose rays go.
pub(crate) struct Company<'a> {
    pub(crate) tree: &'a BlockTree,
    pub(crate) frame: &'a Frame,
    pub(crate) groups: &'a mut [Group],
    /// As given.
    pub(crate) rays: &'a [Ray],
    pub(crate) octant: usize,
}

impl Turns {
    pub(crate) fn new() -> Self {
        let going = Going { ray: Single::NONE, number: 0, axes: [0; 3], shear: None, stack: Stack::new(), next: NONE };
        Self {
            visits: [Visit { entry: 0.0, child: 0, next: NONE }; MOST],
            kept: 0,
            first: [NONE; RAYS],
            last: [NONE; RAYS],
            waiting: 0,
            going: vec![going; ABREAST],
        }
    }

    /// Whether rays are to go.
    #[inline(always)]
    pub(crate) const fn is_enough(&self) -> bool {
        self.kept >= ENOUGH
    }

    /// Each of these rays is to visit a child, after all that it is to visit already.
    #[inline(always)]
    pub(crate) fn keep(&mut self, entry: f32, child: u32, rays: u64) {
        let mut rest = rays;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize % RAYS;
            rest &= rest - 1;
            let place = self.kept % MOST;
            self.visits[place] = Visit { entry, child, next: NONE };
            self.kept = place + 1;
            if self.waiting >> ray & 1 == 1 {
                self.visits[usize::from(self.last[ray]) % MOST].next = place as u8;
            } else {
                self.first[ray] = place as u8;
                self.waiting |= 1 << ray;
            }
            self.last[ray] = place as u8;
        }
    }

    /// The others of a packet need not go any more.
    #[inline(always)]
    pub(crate) const fn keep_only(&mut self, rays: u64) {
        self.waiting &= rays;
    }

    /// All rays visit what they are to visit and all that hangs below: their hits become the nearest so far, or with
    /// `ANY` the first.
    #[inline(always)]
    pub(crate) fn run<L: Level, const ANY: bool>(&mut self, level: L, company: &mut Company<'_>) {
        // Those that go stand in front.
        let (mut count, mut turn) = (0, 0);
        loop {
            if count < ABREAST && self.waiting != 0 {
                let number = self.waiting.trailing_zeros() as usize % RAYS;
                self.waiting &= self.waiting - 1;
                self.begin(level, company, count, number);
                count += 1;
                continue;
            }
            if count == 0 {
                break;
            }
            turn = if turn < count { turn } else { 0 };
            if self.going[turn % ABREAST].step::<L, ANY>(level, company, &self.visits) {
                turn += 1;
            } else {
                count -= 1;
                self.going.swap(turn, count);
            }
        }
        self.kept = 0;
    }

    /// A ray starts on its way.
    #[inline(always)]
    fn begin<L: Level>(&mut self, level: L, company: &Company<'_>, place: usize, number: usize) {
        let (group, lane) = (&company.groups[number / LANES % GROUPS], number % LANES);
        let going = &mut self.going[place % ABREAST];
        going.ray = Single::of(group, lane, company.octant);
        (going.number, going.axes, going.shear) = (number, group.axes_of(lane), None);
        going.next = self.first[number];
        going.stack.cut(0);
        fetch(level, company.tree, self.visits[usize::from(going.next) % MOST].child);
    }
}

impl Going {
    /// What is to be visited next, and no further away than the nearest hit.
    #[inline(always)]
    fn next(&mut self, visits: &[Visit; MOST]) -> Option<u32> {
        loop {
            let (entry, child) = if self.stack.len() > 0 {
                let (entry, child, _) = self.stack.pop();
                (entry, child)
            } else if self.next == NONE {
                return None;
            } else {
                let Visit { entry, child, next } = visits[usize::from(self.next) % MOST];
                self.next = next;
                (entry, child)
            };
            if entry > self.ray.limit {
                continue;
            }
            return Some(child);
        }
    }

    /// Visits one node or block; whether there may be more.
    #[inline(always)]
    fn step<L: Level, const ANY: bool>(&mut self, level: L, company: &mut Company<'_>, visits: &[Visit; MOST]) -> bool {
        let Company { tree, frame, groups, rays, .. } = company;
        let Some(child) = self.next(visits) else { return false };
        let group = &mut groups[self.number / LANES % GROUPS];
        let own = (self.number % LANES, &rays[self.number], self.axes);
        if self.ray.visit::<L, ANY>(level, (tree, frame), group, own, child, &mut self.shear, &mut self.stack) {
            return false;
        }
        if let Some(&child) = self.stack.next(1).first() {
            fetch(level, tree, child);
        }
        true
    }
}
