//! What an estimate costs, learned stream by stream.

use alloc::vec::Vec;
use rt_core::{RayStream, StreamKind, StreamRecord};

/// What walking samples costs, for each kind of stream.
#[derive(Clone, Debug, Default)]
pub(super) struct WalkPrices {
    /// By kind, and whether the stream is coherent.
    known: Vec<((StreamKind, bool), Price)>,
}

/// Who reads samples on the host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Reader {
    /// Each task's own are scaled up.
    #[default]
    Tasks,
    /// A map of costs is made of them.
    Map,
}

/// The price of a sample, in seconds of a traced ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Price {
    /// Of walking it.
    ray: f64,
    /// Of what the host does for it, by each [`Reader`], for every device that waits meanwhile.
    host: [f64; 2],
}

impl Price {
    /// What a walked ray whose hit is kept costs beyond its trace.
    pub(super) fn beyond(&self) -> f64 {
        (self.ray - 1.0).max(LEAST_PRICE)
    }

    /// What a sample costs altogether while `devices` devices wait for its reader.
    pub(super) fn of_sample(&self, devices: u32, reader: Reader) -> f64 {
        self.beyond() + f64::from(devices) * self.host[reader as usize]
    }
}

/// What the host does for a sample, before it was measured: some 20 ns and 0.3 µs (`--bin coverage`), where rays take a
/// quarter of a microsecond to one.
const ASSUMED_HOST: [f64; 2] = [0.1, 0.4];

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

    pub(super) fn learn(&mut self, record: &StreamRecord<'_>, reader: Reader) {
        let (Some(ray), Some(host)) = (record.walk_price(), record.host_price()) else { return };
        let ray = ray.clamp(BELIEVABLE.0, BELIEVABLE.1);
        let kind = (record.stream.kind, record.stream.is_coherent());
        let host = (host / f64::from(record.stream.devices.max(1))).min(BELIEVABLE.1);
        match self.known.iter_mut().find(|(own, _)| *own == kind) {
            Some((_, old)) => {
                old.ray += NEWEST * (ray - old.ray);
                let old = &mut old.host[reader as usize];
                *old += NEWEST * (host - *old);
            }
            None => {
                let mut price = Price { ray, host: ASSUMED_HOST };
                price.host[reader as usize] = host;
                self.known.push((kind, price));
            }
        }
    }
}

/// What estimates have cost beyond their budget, in device seconds, and later streams have to save.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Debt {
    seconds: f64,
}

/// Most streams that pay for one: what a disturbed measurement says of a cost must not end all estimates.
const LONGEST_DEBT: f64 = 8.0;

impl Debt {
    /// It as a share of a trace that takes `trace_s` device seconds.
    pub(super) fn share_of(self, trace_s: f64) -> f64 {
        if trace_s > 0.0 { self.seconds / trace_s } else { 0.0 }
    }

    /// Adds what a stream's estimate cost, and takes off what it was allowed to: `budget`, a share of its trace.
    pub(super) fn settle(&mut self, record: &StreamRecord<'_>, budget: f64) {
        let Some(ray_s) = record.ray_s() else { return };
        let walked = record.walked_rays as f64;
        let allowed = budget * ray_s * (record.traced_rays as f64 + walked);
        let cost = (record.walk_s - walked * ray_s).max(0.0) + record.host_s;
        let most = self.seconds.max(LONGEST_DEBT * allowed);
        self.seconds = (self.seconds + cost - allowed).clamp(0.0, most);
    }
}
