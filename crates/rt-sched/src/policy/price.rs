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

/// How many times a second a device would do all of `parts`; 1 where no such number comes out.
pub(crate) fn speed(device: &CostModel, parts: &[f64; 4]) -> f64 {
    let seconds = seconds(&device.per_part(), parts);
    if seconds > 0.0 && seconds.is_finite() { 1.0 / seconds } else { 1.0 }
}

/// Expected seconds of such parts at such prices.
pub(crate) fn seconds(prices: &[f64; 4], parts: &[f64; 4]) -> f64 {
    prices.iter().zip(parts).map(|(price, part)| price * part).sum()
}
