//! What an estimate costs, learned stream by stream.

use alloc::vec::Vec;
use rt_core::{RayStream, StreamKind, StreamRecord};

/// What walking samples costs, for each kind of stream.
#[derive(Clone, Debug, Default)]
pub(super) struct WalkPrices {
    /// By kind, and whether the stream is coherent.
    known: Vec<((StreamKind, bool), Price)>,
}

/// The price of a sample, in seconds of a traced ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Price {
    /// Of walking it.
    ray: f64,
    /// Of what the host does for it, for every device that waits meanwhile.
    host: f64,
}

impl Price {
    /// What a walked ray whose hit is kept costs beyond its trace.
    pub(super) fn beyond(&self) -> f64 {
        (self.ray - 1.0).max(LEAST_PRICE)
    }

    /// What a sample costs altogether while `devices` devices wait for the host.
    pub(super) fn of_sample(&self, devices: u32) -> f64 {
        self.beyond() + f64::from(devices) * self.host
    }
}

/// What the host does for a sample, before it was measured: some 20 ns (`--bin coverage`), where rays take a quarter of
/// a microsecond to one.
const ASSUMED_HOST: f64 = 0.1;

/// Weight of the newest measurement: on a shared machine single ones are off by some ten percent.
const NEWEST: f64 = 0.5;

/// Least price of a sample beyond its ray, 1%: samples that are walked in packets may cost less than traced rays, but
/// nothing is gained by making more of them for that.
const LEAST_PRICE: f64 = 0.01;

/// Prices lie between a tenth of that of a traced ray and ten times it; beyond, something else was measured.
const BELIEVABLE: (f64, f64) = (0.1, 10.0);

impl WalkPrices {
    /// The price for a kind; before anything was measured, that of rays that share little with their neighbours: 2.2 to
    /// 3.3 times a traced ray where rays are coherent, some 1.6 elsewhere (docs/results/sampling.md).
    pub(super) fn of(&self, stream: &RayStream<'_>) -> Price {
        let assumed = Price { ray: if stream.is_coherent() { 3.0 } else { 1.5 }, host: ASSUMED_HOST };
        let kind = (stream.kind, stream.is_coherent());
        self.known.iter().find(|(own, _)| *own == kind).map_or(assumed, |(_, price)| *price)
    }

    pub(super) fn learn(&mut self, record: &StreamRecord<'_>) {
        let (Some(ray), Some(host)) = (record.walk_price(), record.host_price()) else { return };
        let ray = ray.clamp(BELIEVABLE.0, BELIEVABLE.1);
        let kind = (record.stream.kind, record.stream.is_coherent());
        let host = (host / f64::from(record.stream.devices.max(1))).min(BELIEVABLE.1);
        match self.known.iter_mut().find(|(own, _)| *own == kind) {
            Some((_, old)) => {
                old.ray += NEWEST * (ray - old.ray);
                old.host += NEWEST * (host - old.host);
            }
            None => self.known.push((kind, Price { ray, host })),
        }
    }
}
