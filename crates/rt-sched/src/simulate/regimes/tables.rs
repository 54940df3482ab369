//! The tables of docs/results/scheduling.md: `cargo test -p rt-sched --lib regimes::tables -- --ignored --nocapture`
//! prints them.

use super::*;

/// Prints what launches that cost time on the device do.
#[test]
#[ignore = "prints a table of docs/results/scheduling.md"]
fn launch_prices() {
    let row = [
        ("round robin", Known::Speeds),
        ("lpt", Known::Costs(0.1)),
        ("hybrid", Known::Nothing),
        ("hybrid", Known::Speeds),
        ("hybrid", Known::Costs(0.1)),
        ("hybrid", Known::Costs(0.0)),
    ];
    eprintln!("| devices | n/m | frame, launch | round robin | LPT 10% | uninformed | speeds | 10% | exact |");
    eprintln!("|---|---|---|---|---|---|---|---|---|");
    for (name, speeds) in
        [("3 equal", turns(&[1.0], 3)), ("8 equal", turns(&[1.0], 8)), ("1:2:4", turns(&[1.0, 2.0, 4.0], 3))]
    {
        for (each, frame_s, launch_s) in [
            (16, 5e-3, 1e-4),
            (128, 5e-3, 5e-6),
            (128, 5e-3, 2e-5),
            (128, 5e-3, 1e-4),
            (128, 5e-3, 5e-4),
            (128, 5e-2, 1e-4),
            (1024, 5e-3, 1e-4),
            (1024, 5e-2, 1e-4),
        ] {
            let of = |&(queue, known): &(&str, Known)| {
                let [excess, launches] =
                    launching(queue, &speeds, each * speeds.len() as u32, known, frame_s, launch_s);
                std::format!(" {excess:.2} ({launches:.0}) |")
            };
            let row: String = row.iter().map(of).collect();
            eprintln!("| {name} | {each} | {} ms, {} µs |{row}", frame_s * 1e3, launch_s * 1e6);
        }
    }
}

/// Prints what the price of a hand-over does to each strategy.
#[test]
#[ignore = "prints a table of docs/results/scheduling.md"]
fn hand_overs() {
    /// Pictures, and Student's 97.5% quantile for so many.
    const PICTURES: u32 = 8;
    const QUANTILE: f64 = 2.365;
    let speeds = turns(&[1.0], 8);
    eprintln!("| hand-over, in flight | n/m | round robin | permuted | central | hybrid | LPT 10% | hybrid 10% |");
    eprintln!("|---|---|---|---|---|---|---|---|");
    for (hand_over_s, in_flight) in [(0.0, 2), (1e-5, 2), (1e-4, 2), (1e-3, 2), (1e-4, 1), (1e-3, 1)] {
        for each in [2, 4, 8, 16, 32, 64, 128, 256, 1024] {
            let row = [
                ("round robin", Known::Nothing),
                ("permuted", Known::Nothing),
                ("central", Known::Nothing),
                ("hybrid", Known::Nothing),
                ("lpt", Known::Costs(0.1)),
                ("hybrid", Known::Costs(0.1)),
            ];
            let of = |&(queue, known): &(&str, Known)| {
                let costs = Simulation { hand_over_s, in_flight, ..Simulation::default() };
                let case = Case { costs, ..Case::new(queue, &speeds, each * 8, known) };
                let found: Vec<f64> = (0..PICTURES).map(|seed| case.run(seed)[0]).collect();
                let n = f64::from(PICTURES);
                let mean = found.iter().sum::<f64>() / n;
                let squares = found.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
                let half = QUANTILE * (squares / (n - 1.0) / n).sqrt();
                std::format!(" {mean:.2} ± {half:.2} |")
            };
            let row: String = row.iter().map(of).collect();
            eprintln!("| {} µs, {in_flight} | {each} |{row}", hand_over_s * 1e6);
        }
    }
}

/// Devices whose shares are corrected from pass to pass by the time that they took, as renderers do: how many passes
/// until they end within 2% of each other, and what was lost until then, in passes.
///
/// *Cycles* (`intern/cycles/integrator/work_balancer.cpp`): each weight times (mix of its time and the mean time, 1/m)
/// over its time, unless all are within 2%. *Average*: a tenth of the way to the speed found. Shares are contiguous.
#[test]
#[ignore = "prints a table of docs/results/scheduling.md"]
fn corrected_shares() {
    eprintln!("| devices | rule | passes until 2% | lost until then | excess then, % |");
    eprintln!("|---|---|---|---|---|");
    for (name, speeds) in [
        ("2 equal", turns(&[1.0], 2)),
        ("8 equal", turns(&[1.0], 8)),
        ("1:2:4", turns(&[1.0, 2.0, 4.0], 3)),
        ("1:50:50", turns(&[1.0, 50.0, 50.0], 3)),
    ] {
        for rule in ["Cycles", "average 0.1"] {
            let m = speeds.len();
            let costs = picture(65_536, &speeds, FRAME_S, 1);
            let mut weights = vec![1.0 / m as f64; m];
            let (mut lost, mut passes) = (0.0, 0);
            let excess = loop {
                // Contiguous shares of the tasks, which are so many that rounding does not matter.
                let (mut before, mut times) = (0.0, Vec::new());
                for (weight, speed) in weights.iter().zip(&speeds) {
                    let share = |x: f64| ((x * costs.len() as f64).round() as usize).min(costs.len());
                    let own = &costs[share(before)..share(before + weight)];
                    times.push((own.iter().sum::<f64>() / speed).max(1e-9));
                    before += weight;
                }
                let longest = times.iter().copied().fold(0.0, f64::max);
                let mean = times.iter().sum::<f64>() / m as f64;
                let excess = longest / FRAME_S - 1.0;
                if times.iter().all(|time| (time / mean - 1.0).abs() <= 0.02) || passes == 1000 {
                    break excess;
                }
                (lost, passes) = (lost + excess, passes + 1);
                let speed_found: f64 = weights.iter().zip(&times).map(|(weight, time)| weight / time).sum();
                for (weight, time) in weights.iter_mut().zip(&times) {
                    *weight = if rule == "Cycles" {
                        *weight * (time + (mean - time) / m as f64) / time
                    } else {
                        *weight + 0.1 * (*weight / time / speed_found - *weight)
                    };
                }
                let sum: f64 = weights.iter().sum();
                weights.iter_mut().for_each(|weight| *weight /= sum);
            };
            eprintln!("| {name} | {rule} | {passes} | {lost:.1} | {:.1} |", excess * 100.0);
        }
    }
}

/// Prints the default beside the best strategy in every regime.
#[test]
#[ignore = "prints the table of docs/results/scheduling.md, which takes minutes"]
fn regimes() {
    let machines = [
        equal(2),
        equal(8),
        equal(64),
        three(2.0, 4.0, 3),
        three(2.0, 4.0, 63),
        three(50.0, 50.0, 3),
        three(50.0, 50.0, 63),
        ("16 x 1 + 500".to_owned(), cores_and_card()),
    ];
    print_regimes(&machines, &[2, 8, 32, 128, 1024], 1 << 14, PICTURES);
}

/// Prints the same for many equal devices, of one picture.
#[test]
#[ignore = "prints rows of the table of docs/results/scheduling.md, which takes half an hour"]
fn many_equal_devices() {
    print_regimes(&[equal(1024)], &[2, 8, 64], 1 << 16, 1);
}

/// Prints the same for many devices of three speeds, of one picture.
#[test]
#[ignore = "prints rows of the table of docs/results/scheduling.md, which takes half an hour"]
fn many_unlike_devices() {
    print_regimes(&[three(2.0, 4.0, 1023)], &[2, 8, 64], 1 << 16, 1);
}

fn equal(m: usize) -> (String, Vec<f64>) {
    (std::format!("{m} equal"), turns(&[1.0], m))
}

fn three(a: f64, b: f64, m: usize) -> (String, Vec<f64>) {
    (std::format!("{m} of 1:{a}:{b}"), turns(&[1.0, a, b], m))
}

fn print_regimes(machines: &[(String, Vec<f64>)], tasks_each: &[u32], most_tasks: u32, pictures: u32) {
    const SHARES: [f64; 4] = [0.0, 0.001, 0.01, 0.1];
    let columns = "0 | 0.1% | 1% | 10%";
    eprintln!("| devices | n/m | first: {columns} | later: {columns} |");
    eprintln!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, speeds) in machines {
        for each in tasks_each {
            let tasks = each * speeds.len() as u32;
            if tasks > most_tasks {
                continue;
            }
            let cells = SHARES.map(|share| default_and_best(speeds, tasks, share, pictures));
            let show = |(default, best, name): &(f64, f64, String)| {
                if default - best > 1.0 {
                    std::format!(" **{default:.1}** ({best:.1} {name}) |")
                } else {
                    std::format!(" {default:.1} |")
                }
            };
            let row: String = (0..2).flat_map(|which| cells.iter().map(move |cell| show(&cell[which]))).collect();
            eprintln!("| {name} | {each} |{row}");
        }
    }
}
