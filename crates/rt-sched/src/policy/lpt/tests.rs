//! LPT against the plain algorithm, the optimum and its own promises.

use super::*;
use proptest::prelude::*;

fn works(costs: &[f32]) -> Vec<Work> {
    costs.iter().map(|&c| Work::new(0.0, c, 0.0)).collect()
}

/// Devices of the given seconds per box test.
fn models(per_box: &[f64]) -> Vec<CostModel> {
    per_box.iter().map(|&s| CostModel::new(0.0, 0.0, s, s).expect("valid")).collect()
}

/// Least makespan over all ways to deal the costs to `m` equal devices.
fn best_makespan(costs: &[f64], loads: &mut [f64]) -> f64 {
    let Some((&cost, rest)) = costs.split_first() else { return loads.iter().copied().fold(0.0, f64::max) };
    let mut best = f64::INFINITY;
    for device in 0..loads.len() {
        loads[device] += cost;
        best = best.min(best_makespan(rest, loads));
        loads[device] -= cost;
        // Devices without a task are alike.
        if loads[device] == 0.0 {
            break;
        }
    }
    best
}

/// The plain algorithm: sort, then look at every device for every task.
fn naive(work: &[Work], devices: &[CostModel]) -> Vec<Vec<TaskId>> {
    let mean = mean_model(devices);
    let mut order: Vec<usize> = (0..work.len()).collect();
    order.sort_by(|&a, &b| seconds(&mean, &work[b].parts()).total_cmp(&seconds(&mean, &work[a].parts())));
    let mut lists = vec![Vec::new(); devices.len()];
    let mut ends: Vec<f64> = devices.iter().map(CostModel::per_launch).collect();
    for task in order {
        let end = |d: usize| ends[d] + devices[d].seconds(&work[task]);
        let first = (0..devices.len())
            .min_by(|&a, &b| end(a).total_cmp(&end(b)).then(lists[a].len().cmp(&lists[b].len())))
            .expect("a device");
        ends[first] = end(first);
        lists[first].push(task as TaskId);
    }
    lists
}

#[test]
fn uniform_work_is_dealt_round_robin() {
    let devices = [CostModel::UNIT; 3];
    for cost in [0.0, 1.0, 3.3e20] {
        let schedule = Lpt.schedule(&works(&[cost; 8]), &devices);
        assert_eq!(schedule.lists(), [vec![0, 3, 6], vec![1, 4, 7], vec![2, 5]], "{cost}");
    }
}

#[test]
fn extremes_do_not_panic() {
    assert_eq!(Lpt.schedule(&works(&[1.0]), &[]).lists().len(), 0);
    assert_eq!(Lpt.schedule(&[], &[CostModel::UNIT; 2]).seconds(), [0.0, 0.0]);
    let expensive = [CostModel::new(f64::MAX, 1.0, f64::MAX, f64::MAX).expect("valid"), CostModel::UNIT];
    for devices in [&expensive[..], &expensive[..1], &[expensive[0]; 3]] {
        for cost in [f32::MAX, f32::from_bits(1), 0.0] {
            let schedule = Lpt.schedule(&works(&[cost; 5]), devices);
            assert_eq!(schedule.lists().iter().map(Vec::len).sum::<usize>(), 5);
        }
    }
    let cheap = [CostModel::new(0.0, 0.0, f64::from_bits(1), 0.0).expect("valid"); 2];
    assert_eq!(Lpt.schedule(&works(&[1.0; 4]), &cheap).lists(), [vec![0, 2], vec![1, 3]]);
}

#[test]
fn a_launch_is_paid_before_the_first_task() {
    let devices =
        [CostModel::new(10.0, 1.0, 1.0, 1.0).expect("valid"), CostModel::new(0.0, 2.0, 2.0, 2.0).expect("valid")];
    let schedule = Lpt.schedule(&works(&[4.0, 1.0]), &devices);
    assert_eq!(schedule.lists(), [vec![], vec![0, 1]]);
    assert_eq!(schedule.seconds(), [0.0, 10.0]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// R. L. Graham's bound. Mutants: `most_expensive_first` in increasing order; `replace_first` of the tree that
    /// does not write the root.
    #[test]
    fn is_within_grahams_bound_of_the_optimum(costs in prop::collection::vec(0_u32..100, 1..9), m in 1_usize..4) {
        let exact: Vec<f64> = costs.iter().map(|&c| f64::from(c)).collect();
        let work = works(&costs.iter().map(|&c| c as f32).collect::<Vec<_>>());
        let schedule = Lpt.schedule(&work, &models(&vec![1.0; m]));
        let best = best_makespan(&exact, &mut vec![0.0; m]);
        let graham = 4.0 / 3.0 - 1.0 / (3.0 * m as f64);
        prop_assert!(schedule.makespan() <= best * graham * (1.0 + 1e-9), "{} > {best}", schedule.makespan());
    }

    /// Mutants: `replace_first` of either kind with `max` for `min`; the tree with two siblings.
    #[test]
    fn loads_of_equal_devices_differ_by_one_task_at_most(
        costs in prop::collection::vec(0.0_f32..1e3, 1..800), m in 1_usize..20,
    ) {
        let schedule = Lpt.schedule(&works(&costs), &models(&vec![1e-9; m]));
        let least = schedule.seconds().iter().copied().fold(f64::INFINITY, f64::min);
        let highest = f64::from(costs.iter().copied().fold(0.0, f32::max)) * 1e-9;
        prop_assert!(schedule.makespan() - least <= highest * (1.0 + 1e-6));
    }

    /// Whole costs and power-of-two speeds, so that the plain algorithm's sums are exact and ties agree.
    ///
    /// Mutants: `end < finish` reversed, or `end` without the price; `Classes` that puts all in one class;
    /// launches left out of `members`.
    #[test]
    fn agrees_with_the_plain_algorithm(
        costs in prop::collection::vec(0_u16..2_000, 0..700),
        speeds in prop::collection::vec((0_i32..4, 0_u16..3), 1..10),
    ) {
        let work = works(&costs.iter().map(|&c| f32::from(c) + 1.0).collect::<Vec<_>>());
        let devices: Vec<CostModel> = speeds.iter().map(|&(exponent, launch)| {
            let price = libm::ldexp(1.0, -exponent);
            CostModel::new(f64::from(launch) * 64.0, 0.0, price, 0.0).expect("valid")
        }).collect();
        let schedule = Lpt.schedule(&work, &devices);
        prop_assert_eq!(schedule.lists(), &naive(&work, &devices)[..]);
        let checked = Schedule::new(schedule.lists().to_vec(), &work, &devices).expect("each task once");
        for (a, b) in schedule.seconds().iter().zip(checked.seconds()) {
            prop_assert!((a - b).abs() <= 1e-6 * schedule.makespan(), "{a} {b}");
        }
    }

    /// Mutants: `Units` with a fixed scale; a rank whose scale is 1.
    #[test]
    fn scaling_by_a_power_of_two_changes_nothing(
        costs in prop::collection::vec(0.0_f32..1e4, 0..700), prices in prop::collection::vec(0.5_f64..4.0, 1..9),
        equal: bool, exponent in -300_i32..300,
    ) {
        let factor = libm::ldexp(1.0, exponent);
        let prices = if equal { vec![prices[0]; prices.len()] } else { prices };
        let scaled: Vec<f64> = prices.iter().map(|p| p * factor).collect();
        let work = works(&costs);
        let [a, b] = [models(&prices), models(&scaled)].map(|devices| Lpt.schedule(&work, &devices));
        prop_assert_eq!(a.lists(), b.lists());
        prop_assert!(a.seconds().iter().zip(b.seconds()).all(|(a, b)| a * factor == *b));
    }
}
