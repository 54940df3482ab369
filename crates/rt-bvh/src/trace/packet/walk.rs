//! The traversal loop for packets.

use super::super::lanes::{self, LANES, Lanes, not_above};
use super::super::stack::{Pending, RayGroup, Stack};
use super::super::walk::{Visitor, walk};
use super::filter::PacketFilter;
use super::slabs::PacketSlabs;
use alloc::vec::Vec;
use rt_core::{Node, Scene, Triangle};

/// Where so few rays are left, each goes on alone. Measured: 1 to 3 make no difference, more cost sparse packets time.
const FEW: u32 = 2;

/// Rays that walk together.
pub(super) struct Packet<V> {
    /// One for each ray; the lanes behind them are empty.
    pub(super) visitors: Vec<V>,
    slabs: PacketSlabs,
    filter: PacketFilter,
    /// Rays that go on.
    open: Lanes,
    /// Inner nodes that each ray visited in company.
    nodes: [u32; LANES],
    /// Triangles that each ray was tested against in company.
    triangles: [u32; LANES],
}

impl<'a, V: Visitor<'a>> Packet<V> {
    pub(super) fn new() -> Self {
        Self {
            visitors: Vec::with_capacity(LANES),
            slabs: PacketSlabs::EMPTY,
            filter: PacketFilter::EMPTY,
            open: 0,
            nodes: [0; LANES],
            triangles: [0; LANES],
        }
    }

    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.visitors.clear();
        self.slabs = PacketSlabs::EMPTY;
        self.filter.clear();
        self.open = 0;
        (self.nodes, self.triangles) = ([0; LANES], [0; LANES]);
    }

    /// Adds a ray; at most [`LANES`] of them.
    #[inline(always)]
    pub(super) fn push(&mut self, visitor: V) {
        let lane = self.visitors.len();
        self.slabs.set(lane, &visitor.ray().slabs, visitor.limit());
        if let Some(filter) = visitor.filter() {
            self.filter.set(lane, &filter);
        }
        self.open |= 1 << lane;
        self.visitors.push(visitor);
    }

    /// Walks all rays. The root has two children, and the stack fits the tree.
    #[inline(always)]
    pub(super) fn walk(&mut self, scene: &Scene, nodes: &[Node], stack: &mut Stack) {
        let Stack { entries, ray_groups, .. } = stack;
        let mut used = 0;
        let mut next = RayGroup { rays: self.open, ..RayGroup::EMPTY };
        loop {
            if next.rays.count_ones() <= FEW {
                self.part(nodes, entries, &next);
            } else if next.count > 0 {
                self.leaf(scene, &next);
            } else if let Some(entered) = self.node(&nodes[next.child as usize], next.rays, ray_groups, &mut used) {
                next = entered;
                continue;
            }
            // Limits may have come down since rays were left behind.
            loop {
                if used == 0 {
                    self.report();
                    return;
                }
                used -= 1;
                let group = &ray_groups[used];
                let rays = group.rays & self.open & not_above(&group.entry, &self.slabs.limit);
                if rays != 0 {
                    next = RayGroup { rays, ..*group };
                    break;
                }
            }
        }
    }

    /// Tests both children of a node, leaves behind what is not visited next, and returns what is.
    #[inline(always)]
    fn node(&mut self, node: &Node, rays: Lanes, stack: &mut [RayGroup], used: &mut usize) -> Option<RayGroup> {
        if V::COUNTS {
            lanes::count(&mut self.nodes, rays);
        }
        let (left, enters_left) = self.slabs.enter(&node.bounds[0]);
        let (right, enters_right) = self.slabs.enter(&node.bounds[1]);
        let (entry, entered) = ([left, right], [enters_left & rays, enters_right & rays]);
        let group =
            |side: usize, rays| RayGroup { entry: entry[side], child: node.child[side], count: node.count[side], rays };
        if entered[0] == 0 || entered[1] == 0 {
            let side = usize::from(entered[0] == 0);
            return (entered[side] != 0).then(|| group(side, entered[side]));
        }
        // A single ray goes left first where it enters there no later than on the right.
        let both = entered[0] & entered[1];
        let left_first = both & not_above(&entry[0], &entry[1]);
        let right_first = both & !left_first;
        let (first, last) =
            if left_first.count_ones() >= right_first.count_ones() { (0, right_first) } else { (1, left_first) };
        let mut push = |group| {
            stack[*used] = group;
            *used += 1;
        };
        // The minority visits the first child after the second one.
        if last != 0 {
            push(group(first, last));
        }
        let second = 1 - first;
        let now = entered[first] & !last;
        if now == 0 {
            return Some(group(second, entered[second]));
        }
        push(group(second, entered[second]));
        Some(group(first, now))
    }

    /// Sends each ray alone through what hangs below a child.
    #[inline(always)]
    fn part(&mut self, nodes: &[Node], stack: &mut [Pending], group: &RayGroup) {
        for lane in lanes::each(group.rays) {
            let visitor = &mut self.visitors[lane];
            let start = Pending { child: group.child, count: group.count, entry: group.entry[lane] };
            if walk(nodes, stack, start, visitor).is_break() {
                self.open &= !(1 << lane);
            }
            self.slabs.limit[lane] = visitor.limit();
        }
    }

    /// Visits a leaf.
    #[inline(always)]
    fn leaf(&mut self, scene: &Scene, group: &RayGroup) {
        let (mut company, axis) = self.filter.largest_part(group.rays);
        if company.count_ones() <= FEW {
            company = 0;
        }
        for lane in lanes::each(group.rays & !company) {
            let visitor = &mut self.visitors[lane];
            if visitor.leaf(group.entry[lane], group.child, group.count).is_break() {
                self.open &= !(1 << lane);
            }
            self.slabs.limit[lane] = visitor.limit();
        }
        if company != 0 {
            let triangles = &scene.triangles()[group.child as usize..][..group.count as usize];
            self.triangles(triangles, group.child, company, axis);
        }
    }

    /// Tests triangles, the first of which is number `first` of the scene, with rays of one dominant axis.
    #[inline(always)]
    fn triangles(&mut self, triangles: &[Triangle], first: u32, company: Lanes, axis: usize) {
        for (slot, triangle) in (first..).zip(triangles) {
            let rays = company & self.open;
            if V::COUNTS {
                lanes::count(&mut self.triangles, rays);
            }
            for lane in lanes::each(rays & !self.filter.misses(axis, triangle)) {
                let visitor = &mut self.visitors[lane];
                if visitor.triangle(slot).is_break() {
                    self.open &= !(1 << lane);
                }
                self.slabs.limit[lane] = visitor.limit();
            }
        }
    }

    /// Tells the visitors what was counted for them.
    #[inline(always)]
    fn report(&mut self) {
        if V::COUNTS {
            for (lane, visitor) in self.visitors.iter_mut().enumerate() {
                visitor.boxes(2 * self.nodes[lane]);
                visitor.triangles(self.triangles[lane]);
            }
        }
    }
}
