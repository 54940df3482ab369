//! What `bench` tells: tables for people, and JSON with every single measurement (described in docs/bench.md).

use super::measure::{Measured, QUEUED, Samples, WALKS};
use crate::intervals::worth;
use rt_balance::devices::Opened;
use rt_balance::stats::{Summary, ratios};
use rt_report::Provenance;
use rt_report::table::{Table, grouped, percent, seconds};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Everything one run of `bench` tells.
#[derive(Debug, Serialize)]
pub(crate) struct Results {
    pub(crate) schema: u32,
    pub(crate) provenance: Provenance,
    pub(crate) repeat: u32,
    pub(crate) paper: Paper,
    /// One entry for each scene and device.
    pub(crate) results: Vec<DeviceResult>,
}

/// Seconds of reduced over full traversal in M. Rincón-Nigro and Z. Deng, *Cost-based Workload Balancing for Ray
/// Tracing on Multi-GPU Systems* (2013), on a Tesla C1060.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Paper {
    pub(crate) coherent: f64,
    pub(crate) diffuse: f64,
}

pub(crate) const PAPER: Paper = Paper { coherent: 0.425, diffuse: 0.435 };

#[derive(Clone, Debug, Serialize)]
pub(crate) struct SceneResult {
    pub(crate) source: String,
    pub(crate) triangles: usize,
    pub(crate) builder: String,
    pub(crate) precision: &'static str,
    /// Of nodes, triangles and ids.
    pub(crate) bytes: u64,
}

/// One scene on one device.
#[derive(Debug, Serialize)]
pub(crate) struct DeviceResult {
    scene: SceneResult,
    device: DeviceDescription,
    /// Seconds until the scene was on the device.
    scene_upload_s: f64,
    rays: Vec<KindResult>,
}

#[derive(Debug, Serialize)]
struct DeviceDescription {
    entry: String,
    name: String,
    backend: &'static str,
    driver: Option<String>,
    software: Option<bool>,
    /// How its kernels are compiled.
    kernels: Option<&'static str>,
    /// Whether it has a tree and a triangle test of its own: then the scene's builder, bytes and precision are not its.
    own_tree: bool,
}

/// One kind of rays.
#[derive(Debug, Serialize)]
struct KindResult {
    kind: &'static str,
    /// Of one launch.
    rays: u32,
    /// Million rays a second: in kernels of full traversal.
    full_mray_s: Summary,
    /// Million rays a second: from the submission until the hits are on the host.
    whole_mray_s: Summary,
    /// Million rays a second in kernels of each walk.
    walks_mray_s: BTreeMap<&'static str, Summary>,
    /// Seconds of each walk over those of full traversal in the same repetition.
    over_full: BTreeMap<&'static str, Summary>,
    launch_gap_s: Summary,
    kernel_share: Summary,
    upload_bytes: u64,
    upload_s: Summary,
    read_back_bytes: u64,
    read_back_s: Summary,
    on_host: u64,
    samples: Raw,
}

/// Every measurement, in the order in which it was taken.
#[derive(Debug, Serialize)]
struct Raw {
    full_s: Vec<f64>,
    whole_s: Vec<f64>,
    walks_s: BTreeMap<&'static str, Vec<f64>>,
    launch_gap_s: Vec<f64>,
    kernel_share: Vec<f64>,
    upload_s: Vec<f64>,
    read_back_s: Vec<f64>,
}

impl DeviceResult {
    pub(crate) fn new(named: &Opened, scene: SceneResult, measured: Measured) -> Self {
        let info = named.device.info();
        let card = named.card.as_ref();
        let device = DeviceDescription {
            entry: named.entry.clone(),
            name: info.name.clone(),
            backend: info.backend,
            driver: card.map(|card| card.driver.clone()),
            software: card.map(|card| card.software),
            kernels: card.map(|card| card.kernels),
            own_tree: !info.capabilities.has_defined_bits(),
        };
        let rays = measured.kinds.into_iter().map(KindResult::new).collect();
        Self { scene, device, scene_upload_s: measured.scene_upload_s, rays }
    }
}

impl KindResult {
    fn new(samples: Samples) -> Self {
        let speed = |s: &[f64]| Summary::new(&s.iter().map(|s| f64::from(samples.rays) / s / 1e6).collect::<Vec<_>>());
        let walks = || WALKS.iter().map(|(name, _)| *name).zip(&samples.walks_s).filter(|(_, s)| !s.is_empty());
        Self {
            kind: samples.kind,
            rays: samples.rays,
            full_mray_s: speed(&samples.full_s),
            whole_mray_s: speed(&samples.whole_s),
            walks_mray_s: walks().map(|(name, s)| (name, speed(s))).collect(),
            over_full: walks().map(|(name, s)| (name, Summary::new(&ratios(s, &samples.full_s)))).collect(),
            launch_gap_s: Summary::new(&samples.gap_s),
            kernel_share: Summary::new(&samples.kernel_share),
            upload_bytes: samples.uploaded,
            upload_s: Summary::new(&samples.upload_s),
            read_back_bytes: samples.downloaded,
            read_back_s: Summary::new(&samples.read_back_s),
            on_host: samples.on_host,
            samples: Raw {
                walks_s: walks().map(|(name, s)| (name, s.clone())).collect(),
                full_s: samples.full_s,
                whole_s: samples.whole_s,
                launch_gap_s: samples.gap_s,
                kernel_share: samples.kernel_share,
                upload_s: samples.upload_s,
                read_back_s: samples.read_back_s,
            },
        }
    }

    /// What the paper says of such rays.
    fn paper(&self) -> Option<f64> {
        match self.kind {
            "primary" => Some(PAPER.coherent),
            "diffuse" => Some(PAPER.diffuse),
            _ => None,
        }
    }
}

/// What the tables show, in words.
pub(crate) fn introduction(repeat: u32) -> String {
    let sure = worth(&Summary::new(&vec![0.0; repeat as usize]));
    format!(
        "Mray/s of full traversal, in kernels and until the hits are on the host; other walks as kernel time over full.\n\
         Medians of {repeat} interleaved repetitions. {sure}\n\
         paper: reduced over full traversal in Rincón-Nigro and Deng (2013), on a Tesla C1060.\n\
         gap: time without a kernel for each of {QUEUED} launches in a row, and their share inside kernels.\n",
    )
}

/// A device's results on one scene.
pub(crate) fn table(result: &DeviceResult) -> String {
    let DeviceResult { scene, device, scene_upload_s, rays } = result;
    let tree = match device.own_tree {
        true => "the device's own tree and triangle test".to_owned(),
        false => {
            format!("tree of {:.1} MB by {}, {} precision", scene.bytes as f64 / 1e6, scene.builder, scene.precision)
        }
    };
    let mut text = format!(
        "{}: {} triangles, {tree}\n{}: {}",
        scene.source,
        grouped(scene.triangles as u64),
        device.entry,
        device.name,
    );
    for detail in [&device.driver.as_deref(), &device.kernels].into_iter().flatten() {
        let _ = write!(text, ", {detail}");
    }
    let _ = writeln!(text, "; scene on the device in {}\n", seconds(*scene_upload_s));
    let mut table = Table::new(&[
        "rays",
        "",
        "Mray/s",
        "to host",
        "exact counts",
        "leaf as hit",
        "unshortened",
        "paper",
        "gap",
        "in kernels",
        "up",
        "",
        "back",
        "",
        "on host",
    ]);
    for kind in rays {
        let over = |name| kind.over_full.get(name).map_or_else(|| percent(None), share);
        table.row(vec![
            kind.kind.to_owned(),
            grouped(kind.rays.into()),
            interval(&kind.full_mray_s, 1.0, 2, ""),
            format!("{:.2}", kind.whole_mray_s.median),
            over("exact_counts"),
            over("leaf_as_hit"),
            over("unshortened"),
            percent(kind.paper()),
            seconds(kind.launch_gap_s.median),
            percent(Some(kind.kernel_share.median)),
            megabytes(kind.upload_bytes),
            seconds(kind.upload_s.median),
            megabytes(kind.read_back_bytes),
            seconds(kind.read_back_s.median),
            grouped(kind.on_host),
        ]);
    }
    text.push_str(&table.to_string());
    text
}

/// Several devices' speeds on one scene, a row for each.
pub(crate) fn side_by_side(results: &[DeviceResult]) -> String {
    let kinds: Vec<&str> =
        results.first().map_or_else(Vec::new, |first| first.rays.iter().map(|kind| kind.kind).collect());
    let source = results.first().map_or("", |first| &first.scene.source);
    let mut table = Table::new(&[&["Mray/s to host"][..], &kinds].concat());
    for DeviceResult { device, rays, .. } in results {
        let speeds = rays.iter().map(|kind| interval(&kind.whole_mray_s, 1.0, 2, ""));
        table.row([device.entry.clone()].into_iter().chain(speeds).collect());
    }
    format!("{source}, side by side\n\n{table}")
}

fn share(summary: &Summary) -> String {
    interval(summary, 100.0, 1, "%")
}

/// The median and its interval.
fn interval(summary: &Summary, scale: f64, digits: usize, unit: &str) -> String {
    let median = format!("{:.digits$}{unit}", summary.median * scale);
    match summary.interval() {
        Some([low, high]) => format!("{median} [{:.digits$}, {:.digits$}]", low * scale, high * scale),
        None => median,
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails when ratios are made of medians, or of walks over other repetitions.
    #[test]
    fn ratios_are_of_one_repetition() {
        let samples = Samples {
            kind: "diffuse",
            rays: 1_000_000,
            full_s: vec![1.0, 2.0, 10.0],
            walks_s: [vec![1.0, 2.0, 10.0], vec![0.5, 1.0, 5.0], vec![2.0, 3.0, 4.0]],
            whole_s: vec![2.0; 3],
            ..Samples::default()
        };
        let result = KindResult::new(samples);
        assert_eq!((result.full_mray_s.median, result.whole_mray_s.median), (0.5, 0.5));
        let median = |name| result.over_full.get(name).map(|summary| summary.median);
        assert_eq!([median("exact_counts"), median("leaf_as_hit"), median("unshortened")], [1.0, 0.5, 1.5].map(Some));
        assert_eq!(result.paper(), Some(0.435));
        assert_eq!(share(&Summary::new(&[0.4, 0.5, 0.6])), "50.0% [40.0, 60.0]");
    }
}
