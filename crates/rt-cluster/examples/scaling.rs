//! Deals on clusters that nobody has: what a frame takes above the ideal, and how busy rank 0 is with messages.
//!
//! `cargo run --release -p rt-cluster --example scaling` writes the tables of docs/scaling.md.

use rt_cluster::Patience;
use rt_cluster::simulate::{Scenario, SimulatedRank, simulate};
use rt_core::random;
use std::io::{self, Write};

/// Seconds that rank 0 takes for a message, to decode, decide and encode: assumed, not measured.
const MESSAGE_S: f64 = 5e-6;

/// Seconds until a message arrives, and by how much that varies: a switched network.
const LATENCY_S: [f64; 2] = [20e-6, 20e-6];

/// What tiles cost beside each other: neighbours alike, a tenth of the picture several times as expensive.
fn tiles(count: u32, total_s: f64) -> Vec<f32> {
    let cost = |tile: u32| {
        let region = tile * 64 / count;
        let [base, hot] = random::pair(7, region, 0);
        let [noise, _] = random::pair(8, tile, 0);
        (0.5 + base) * (0.7 + 0.6 * noise) * if hot < 0.1 { 5.0 } else { 1.0 }
    };
    let costs: Vec<f32> = (0..count).map(cost).collect();
    let sum: f64 = costs.iter().map(|&cost| f64::from(cost)).sum();
    costs.iter().map(|&cost| (f64::from(cost) * total_s / sum) as f32).collect()
}

/// Prices that are off by some 15%, as those of sixteen paths are.
fn prices(tiles: &[f32]) -> Vec<f32> {
    (0..).zip(tiles).map(|(tile, &seconds)| seconds * (0.75 + 0.5 * random::pair(9, tile, 0)[0])).collect()
}

fn main() -> io::Result<()> {
    let mut out = io::stdout();
    writeln!(
        out,
        "| ranks | tiles a rank | ideal frame, s | excess | excess without prices | messages/s | rank 0 busy |"
    )?;
    writeln!(out, "|---:|---:|---:|---:|---:|---:|---:|")?;
    for (ranks, frame_s) in [(4, 1.0), (16, 1.0), (64, 1.0), (256, 1.0), (1000, 1.0), (1000, 10.0), (1000, 100.0)] {
        for per_rank in [16, 64] {
            let tiles = tiles(ranks * per_rank, frame_s * f64::from(ranks));
            let run = |prices| {
                let scenario = Scenario {
                    tiles: tiles.clone(),
                    prices,
                    ranks: vec![SimulatedRank::default(); ranks as usize],
                    latency_s: LATENCY_S[0],
                    jitter_s: LATENCY_S[1],
                    message_s: MESSAGE_S,
                    tick_s: 0.001_f64.max(frame_s * 1e-3),
                    patience: Patience::default(),
                    seed: 1,
                };
                simulate(&scenario)
            };
            let (known, unknown) = (run(prices(&tiles)), run(Vec::new()));
            writeln!(
                out,
                "| {ranks} | {per_rank} | {frame_s} | {:.1}% | {:.1}% | {:.0} | {:.1}% |",
                100.0 * (known.makespan_s / frame_s - 1.0),
                100.0 * (unknown.makespan_s / frame_s - 1.0),
                known.messages as f64 / known.makespan_s,
                100.0 * known.server_s / known.makespan_s,
            )?;
        }
    }
    Ok(())
}
