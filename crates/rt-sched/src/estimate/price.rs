//! What an estimate costs, learned stream by stream.

use alloc::vec::Vec;
use rt_core::{StreamKind, StreamRecord};

/// What walking samples costs, for each kind of stream.
#[derive(Clone, Debug, Default)]
pub(super) struct WalkPrices {
    known: Vec<(StreamKind, Price)>,
}

/// The price of an estimate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Price {
    /// Seconds of a walked ray in seconds of a traced one.
    pub(super) ray: f64,
    /// What the host does beside, as a share of the trace.
    pub(super) host: f64,
}

impl Price {
    /// What a walked ray whose hit is kept costs beyond its trace, in seconds of a traced one.
    pub(super) fn beyond(&self) -> f64 {
        (self.ray - 1.0).max(LEAST_PRICE)
    }

    /// The largest fraction whose estimate costs no more than `budget`, a share of the trace.
    pub(super) fn fraction_for(&self, budget: f64) -> f64 {
        (budget - self.host).max(0.0) / self.beyond()
    }
}

/// Weight of the newest measurement: on a shared machine single ones are off by some ten percent.
const NEWEST: f64 = 0.5;

/// Least price of a sample beyond its ray, 1%: samples that are walked in packets may cost less than traced rays, but
/// nothing is gained by making more of them for that.
const LEAST_PRICE: f64 = 0.01;

/// Prices lie between a tenth of that of a traced ray and ten times it; beyond, something else was measured.
const BELIEVABLE: (f64, f64) = (0.1, 10.0);

/// Largest believable share of the host: a stream of a few rays is not the measure of others.
const MOST_HOST: f64 = 0.1;

impl WalkPrices {
    /// The price for a kind; before anything was measured, that of rays that share little with their neighbours: 2.2 to
    /// 3.3 times a traced ray where rays are coherent, some 1.6 elsewhere (docs/results/sampling.md).
    pub(super) fn of(&self, kind: StreamKind) -> Price {
        let assumed = Price { ray: if kind.is_coherent() { 3.0 } else { 1.5 }, host: 0.0 };
        self.known.iter().find(|(own, _)| *own == kind).map_or(assumed, |(_, price)| *price)
    }

    pub(super) fn learn(&mut self, record: &StreamRecord<'_>) {
        let (Some(ray), Some(host)) = (record.walk_price(), record.host_share()) else { return };
        let new = Price { ray: ray.clamp(BELIEVABLE.0, BELIEVABLE.1), host: host.min(MOST_HOST) };
        match self.known.iter_mut().find(|(own, _)| *own == record.stream.kind) {
            Some((_, old)) => {
                old.ray += NEWEST * (new.ray - old.ray);
                old.host += NEWEST * (new.host - old.host);
            }
            None => self.known.push((record.stream.kind, new)),
        }
    }
}
