//! What the rays of tasks cost, estimated beside measured: task by task, as a map of the picture, and as `cost.png`.

mod map;
mod picture;
mod scale;
mod tasks;

pub(crate) use map::TaskCost;
pub use map::{CostMap, CostMaps, each_ray};
pub use picture::write_png;
use scale::Top;
pub(crate) use tasks::{Origin, TaskCosts};

/// One ray in how many was sampled, as a share tells it.
pub(crate) fn one_in(fraction: f64) -> String {
    if fraction > 0.0 { format!("1 ray in {:.0}", 1.0 / fraction) } else { "no ray".to_owned() }
}
