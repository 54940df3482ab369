//! What a walked ray costs, learned stream by stream.

use alloc::vec::Vec;
use rt_core::{StreamKind, StreamRecord};

/// Seconds of a walked ray in seconds of a traced one, for each kind of stream.
#[derive(Clone, Debug, Default)]
pub(super) struct WalkPrices {
    known: Vec<(StreamKind, f64)>,
}

/// Weight of the newest measurement: on a shared machine single ones are off by some ten percent.
const NEWEST: f64 = 0.5;

/// Prices lie between that of a ray in a full batch and ten times it; beyond, something else was measured.
const BELIEVABLE: (f64, f64) = (1.0, 10.0);

impl WalkPrices {
    /// The price for a kind; before anything was measured, that of a scalar kernel that finds little in its caches
    /// (2.5 to 3.3 for coherent rays, whose neighbours are not walked with them; less for incoherent ones).
    pub(super) fn of(&self, kind: StreamKind) -> f64 {
        let assumed = if kind.is_coherent() { 3.0 } else { 1.5 };
        self.known.iter().find(|(own, _)| *own == kind).map_or(assumed, |(_, price)| *price)
    }

    pub(super) fn learn(&mut self, record: &StreamRecord<'_>) {
        let Some(price) = record.walk_price() else { return };
        let price = price.clamp(BELIEVABLE.0, BELIEVABLE.1);
        match self.known.iter_mut().find(|(own, _)| *own == record.stream.kind) {
            Some((_, old)) => *old += NEWEST * (price - *old),
            None => self.known.push((record.stream.kind, price)),
        }
    }
}
