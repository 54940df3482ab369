//! What an estimate costs, learned stream by stream.

use alloc::vec::Vec;
use rt_core::{RayStream, StreamKind, StreamRecord};

/// What walking samples costs, for each kind of stream.
#[derive(Clone, Debug, Default)]
pub struct WalkPrices {
    /// By kind, and whether the stream is coherent.
    known: Vec<((StreamKind, bool), Price)>,
}

/// The price of a sample, in seconds of a traced ray.
#[derive(Clone, Copy, Debug)]
pub struct Price {
    /// Of walking it.
    ray: f64,
    /// Of what the host does for it, for every device that waits meanwhile.
    host: f64,
}

impl Price {
    /// What a walked ray whose hit is kept costs beyond its trace.
    pub fn beyond(&self) -> f64 {
        (self.ray - 1.0).max(LEAST_PRICE)
    }

    /// What a sample costs altogether while `devices` devices wait for the host.
    pub fn of_sample(&self, devices: u32) -> f64 {
        self.beyond() + f64::from(devices) * self.host
    }
}

/// Prices before anything was measured, of 1 ray in 128, which two samples of the smallest tasks are: a coherent ray
/// that is walked takes as long as 6.6 to 7.5 traced ones, which share a packet with their neighbours, and others as
/// long as 2.2 (docs/results/sampling.md). The host does some 20 ns for a sample (`--bin coverage`), where traced rays
/// take 35 and 250.
const ASSUMED_COHERENT: Price = Price { ray: 7.0, host: 0.5 };
const ASSUMED_OTHERWISE: Price = Price { ray: 2.2, host: 0.1 };

/// Weight of the newest measurement: on a shared machine single ones are off by some ten percent.
const NEWEST: f64 = 0.5;

/// Least price of a sample beyond its ray, 1%: samples that are walked in packets may cost less than traced rays, but
/// nothing is gained by making more of them for that.
const LEAST_PRICE: f64 = 0.01;

/// Prices lie between a tenth of that of a traced ray and ten times it; beyond, something else was measured.
const BELIEVABLE: (f64, f64) = (0.1, 10.0);

impl WalkPrices {
    /// The price for a kind, as measured or assumed.
    pub fn of(&self, stream: &RayStream<'_>) -> Price {
        let assumed = if stream.is_coherent() { ASSUMED_COHERENT } else { ASSUMED_OTHERWISE };
        let kind = (stream.kind, stream.is_coherent());
        self.known.iter().find(|(own, _)| *own == kind).map_or(assumed, |(_, price)| *price)
    }

    /// Learns from what the samples of a stream cost; one without samples tells nothing.
    pub fn learn(&mut self, record: &StreamRecord<'_>) {
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
