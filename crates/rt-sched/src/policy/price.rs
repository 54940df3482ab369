//! Prices of many tasks or many devices at once.

use rt_core::{CostModel, Work};

/// The price of each of [`Work::parts`], averaged over `devices`, in seconds.
pub(crate) fn mean_model(devices: &[CostModel]) -> [f64; 4] {
    let share = 1.0 / devices.len().max(1) as f64;
    let mut mean = [0.0; 4];
    for d in devices {
        for (sum, part) in mean.iter_mut().zip(d.per_part()) {
            *sum += part * share;
        }
    }
    mean
}

/// Every one of [`Work::parts`], over all of `work`.
pub(crate) fn total(work: &[Work]) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for w in work {
        for (sum, part) in sum.iter_mut().zip(w.parts()) {
            *sum += part;
        }
    }
    sum
}

/// Expected seconds of such parts at such prices.
pub(crate) fn seconds(prices: &[f64; 4], parts: &[f64; 4]) -> f64 {
    prices.iter().zip(parts).map(|(price, part)| price * part).sum()
}
