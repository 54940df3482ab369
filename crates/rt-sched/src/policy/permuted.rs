//! Regions in an order that spreads them, shared by speed.

use super::{Policy, dealt, speed, total};
use crate::Schedule;
use alloc::vec::Vec;
use rt_core::{CostModel, TaskId, Work};

/// Regions of the picture in bit-reversed order, of which each device gets a contiguous share by its speed: what needs
/// no costs, but speeds.
///
/// After D. van Antwerpen, D. Seibert and A. Keller, *A Simple Load-Balancing Scheme with High Scaling Efficiency*
/// (2019), who permute regions of at least 128 pixels. A task is a region here: ours are larger than that.
#[derive(Clone, Copy, Debug, Default)]
pub struct PermutedRegions;

impl Policy for PermutedRegions {
    fn name(&self) -> &'static str {
        "permuted-regions"
    }

    fn schedule(&self, work: &[Work], devices: &[CostModel]) -> Schedule {
        let sum = total(work);
        let all: f64 = devices.iter().map(|device| speed(device, &sum)).sum();
        let mut order = spread(work.len()).map(|task| task as TaskId);
        let mut reached = 0.0;
        let lists = devices.iter().map(|device| {
            let before = end(reached, work.len());
            reached += speed(device, &sum) / all;
            order.by_ref().take(end(reached, work.len()) - before).collect::<Vec<TaskId>>()
        });
        let mut lists: Vec<Vec<TaskId>> = lists.collect();
        // What rounding has left.
        lists.iter_mut().take(1).for_each(|list| list.extend(order.by_ref()));
        dealt(lists, work, devices)
    }
}

/// How many of `tasks` are before a `share` of them.
fn end(share: f64, tasks: usize) -> usize {
    libm::round(share * tasks as f64) as usize
}

/// The numbers below `count` in an order of which every stretch is spread over all of them: the radical inverse of J.
/// van der Corput (1935).
pub(crate) fn spread(count: usize) -> impl Iterator<Item = usize> {
    let bits = count.next_power_of_two().trailing_zeros();
    let reversed = move |i: usize| if bits == 0 { i } else { i.reverse_bits() >> (usize::BITS - bits) };
    (0..count.next_power_of_two()).map(reversed).filter(move |&place| place < count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    /// Mutants: speeds left out; tasks in their own order; shares that are rounded down, one after the other.
    #[test]
    fn shares_go_by_speed_and_come_from_all_over() {
        let work = vec![Work::new(1.0, 1.0, 0.0); 14];
        let speed = |s: f64| CostModel::new(0.0, 1.0 / s, 1.0 / s, 0.0).expect("a model");
        let schedule = PermutedRegions.schedule(&work, &[speed(1.0), speed(1.0), speed(5.0)]);
        assert_eq!(schedule.lists()[..2], [vec![0, 8], vec![4, 12]]);
        assert_eq!(schedule.lists()[2], [2, 10, 6, 1, 9, 5, 13, 3, 11, 7]);
        assert_eq!(PermutedRegions.schedule(&work, &[]).lists().len(), 0);
        assert_eq!(PermutedRegions.schedule(&[], &[speed(1.0); 2]).lists(), [vec![], vec![]]);
    }
}
