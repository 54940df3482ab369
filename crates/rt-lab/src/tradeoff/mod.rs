//! `raybalance tradeoff`: what speed costs in accuracy, in memory and in time to prepare, measured.

mod build;
mod layout;
pub mod precision;
mod sampling;
mod setting;
mod streams;

use crate::Lab;
use crate::subject::Subject;
use crate::time_budget::TimeBudget;
use anyhow::{Context, Result, anyhow};
use rt_balance::Scheduling;
use rt_balance::devices::Opener;
use rt_core::Device;
use rt_report::html::Page;
use rt_report::output::Outputs;
use rt_report::usage::usage;
use rt_report::{Provenance, table};
use rt_scene::prepare::short_name;
use setting::{Head, Setting, file_part};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Something to be traded, such as samples for accuracy.
struct Trade {
    name: &'static str,
    /// Share of the time, relative to the other trades'.
    weight: f64,
    /// How many times about as many rays as a picture has pixels are traced in a round on a scene.
    passes: fn(&Options) -> f64,
    run: fn(&Setting<'_>, &mut Page) -> Result<()>,
    /// The kinds of its files that are one for all scenes, and of those that are one for each.
    files: (&'static [&'static str], &'static [&'static str]),
}

impl Trade {
    /// Names of all files that it writes about some scenes.
    fn files(&self, scenes: &[PathBuf]) -> Vec<String> {
        let (once, each) = self.files;
        let of_scene = |scene: &PathBuf| {
            let scene = file_part(&short_name(scene));
            each.iter().map(move |kind| format!("{}-{scene}.{kind}", self.name)).collect::<Vec<_>>()
        };
        once.iter().map(|kind| format!("{}.{kind}", self.name)).chain(scenes.iter().flat_map(of_scene)).collect()
    }
}

/// Every trade there is, in the order in which `raybalance tradeoff` runs them.
const TRADES: [Trade; 4] = [
    // Hundreds of settings against a few.
    Trade { name: "sampling", weight: 4.0, passes: sampling::passes, run: sampling::run, files: FILES },
    Trade {
        name: "precision",
        weight: 1.0,
        passes: precision::passes,
        run: precision_of_all,
        files: (&["json", "csv", "md", "svg"], &[]),
    },
    Trade { name: "build", weight: 1.0, passes: build::passes, run: build::run, files: FILES },
    Trade { name: LAYOUT, weight: 1.0, passes: layout::passes, run: layout::run, files: FILES },
];

/// What most trades write.
const FILES: (&[&str], &[&str]) = (&["md", "csv", "json"], &["svg"]);

/// The page of all trades.
const PAGE: &str = "report.html";

/// The trade that needs devices with a choice of layouts.
const LAYOUT: &str = "layout";

const TITLE: &str = "Speed against accuracy and memory";

/// What is measured by trades of one device unless something else is named.
const DEVICE: &str = "cpu:1";

/// Budget of all trades together.
const ALL_TRADES: Duration = Duration::from_secs(600);
const QUICK_ALL_TRADES: Duration = Duration::from_secs(150);

/// As for figure 1: see there.
const SIZE: [u32; 2] = [1024, 640];
const QUICK_SIZE: [u32; 2] = [320, 200];
const REPEAT: u32 = 9;
const QUICK_REPEAT: u32 = 2;

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Built-in scenes or OBJ files.
    pub scenes: Vec<PathBuf>,
    /// The device to measure, of the trade of layouts a list; `None`: one core, and every graphics card.
    pub devices: Option<String>,
    /// Size of the picture in pixels, one ray each; `None`: as suits the extent, smaller where a budget demands it.
    pub size: Option<[u32; 2]>,
    /// Rounds that count; `None`: as suits the extent.
    pub repeat: Option<u32>,
    /// Seconds that it may take; `None`: of all trades together as suits the extent, of one as long as it takes.
    pub budget: Option<u32>,
    /// Seed of samples, pixels and bounces.
    pub seed: u32,
    /// Small pictures, few settings and rounds: a look at the form, not a measurement.
    pub quick: bool,
    /// Folder of what is written.
    pub out: PathBuf,
}

/// One trade that is measured alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chosen {
    /// Samples against accuracy.
    Sampling,
    /// Build time against rays per second.
    Build,
    /// Memory of the tree's layout against rays per second.
    Layout,
}

impl Chosen {
    const fn name(self) -> &'static str {
        match self {
            Self::Sampling => "sampling",
            Self::Build => "build",
            Self::Layout => LAYOUT,
        }
    }
}

/// Measures one trade, or without one all of them.
///
/// # Errors
/// When a scene cannot be prepared, a device not be opened or fails, or a file not be written.
pub fn run(lab: Lab<'_>, options: &Options, chosen: Option<Chosen>) -> Result<()> {
    let (common, chosen) = (options, chosen.map(Chosen::name));
    let mut trades: Vec<&Trade> = TRADES.iter().filter(|trade| chosen.is_none_or(|name| name == trade.name)).collect();
    let outputs = outputs(&common.out, &trades, &common.scenes)?;
    let lab = lab.writing(&outputs);
    let (cards, mut left_out) = match chosen {
        None | Some(LAYOUT) => layout::cards(common.devices.as_deref())?,
        _ => (Vec::new(), Vec::new()),
    };
    if cards.is_empty() && chosen == Some(LAYOUT) {
        let reasons = left_out.join("; ");
        return Err(if common.devices.is_some() { usage(reasons).into() } else { anyhow!(reasons) });
    }
    if cards.is_empty() {
        trades.retain(|trade| trade.name != LAYOUT);
        left_out.iter_mut().for_each(|reason| *reason = format!("The trade layout is left out: {reason}."));
    }
    left_out.iter().try_for_each(|reason| lab.show.print(reason))?;
    let devices = if chosen == Some(LAYOUT) { layout::one_each(&cards) } else { vec![one_device(common)?] };

    let seeds =
        format!("Seed {} of pixels, bounces and samples; those of each round are in the JSON files.", common.seed);
    let cards_too = layout::one_each(&cards);
    let mut measured: Vec<&str> = devices.iter().chain(&cards_too).map(|device| device.info().name.as_str()).collect();
    measured.dedup();
    let mut page = Page::new(TITLE, &Provenance::now(common.seed, measured), &seeds);
    left_out.iter().for_each(|reason| page.paragraph(reason));
    let begin = Instant::now();
    let all = if common.quick { QUICK_ALL_TRADES } else { ALL_TRADES };
    let budget = common.budget.map(|seconds| Duration::from_secs(seconds.into()));
    let time = TimeBudget::whole(lab.show, budget.or(chosen.is_none().then_some(all)));
    let weights: Vec<f64> = trades.iter().map(|trade| trade.weight).collect();
    for (index, trade) in trades.into_iter().enumerate() {
        let time = time.part(&weights, index);
        time.label(trade.name);
        let on = if trade.name == LAYOUT { &layout::one_each(&cards) } else { &devices };
        let setting = setting(lab, common, trade, (on, &cards), time)?;
        (trade.run)(&setting, &mut page)?;
    }
    time.finish();
    finish(lab, &page, &common.out, begin)
}

/// The files of all trades, which can be written.
fn outputs(out: &Path, trades: &[&Trade], scenes: &[PathBuf]) -> Result<Outputs> {
    let files = trades.iter().flat_map(|trade| trade.files(scenes)).chain([PAGE.to_owned()]);
    let outputs = Outputs::new().folder("--out", out, files).scenes(scenes);
    outputs.check()?;
    Ok(outputs)
}

/// The device that is named, or the usual one.
fn one_device(args: &Options) -> Result<Arc<dyn Device>> {
    let list = args.devices.as_deref().unwrap_or(DEVICE);
    let mut devices = Opener::new().open(list).context("--devices")?;
    match (devices.pop(), devices.is_empty()) {
        (Some(opened), true) => Ok(opened.device),
        _ => Err(usage(format!(
            "--devices {list}: name one device, such as {DEVICE}; only the trades layout and precision take more"
        ))
        .into()),
    }
}

/// How a trade is measured on some devices; `cards` are the same opened for each layout, where that is wanted.
fn setting<'a>(
    lab: Lab<'a>,
    args: &'a Options,
    trade: &Trade,
    (devices, cards): (&'a [Arc<dyn Device>], &'a [layout::Card]),
    time: TimeBudget<'a>,
) -> Result<Setting<'a>> {
    let most = if args.quick { QUICK_SIZE } else { SIZE };
    let size = match (args.size, time.left()) {
        (Some(size), _) => size,
        (None, None) => most,
        (None, Some(left)) => {
            let passes = (trade.passes)(args) * (args.scenes.len() * devices.len()) as f64;
            size_within(left, passes / rays_per_second(lab, args, devices)?, most)
        }
    };
    let head = Head {
        schema: 2,
        provenance: Provenance::now(args.seed, devices.iter().map(|device| device.info().name.clone())),
        size,
    };
    let repeat = args.repeat.unwrap_or(if args.quick { QUICK_REPEAT } else { REPEAT });
    Ok(Setting { lab, args, devices, cards, size, repeat, time, head })
}

/// Rays that the devices trace in a second, together or in turn: of the first scene, primary and diffuse ones.
fn rays_per_second(lab: Lab<'_>, args: &Options, devices: &[Arc<dyn Device>]) -> Result<f64> {
    let Some(scene) = args.scenes.first() else { return Ok(f64::INFINITY) };
    let mut subject = Subject::open(lab, scene, devices)?;
    let (mut rays, mut seconds) = (0.0, 0.0);
    for stream in &subject.streams(QUICK_SIZE, args.seed)? {
        let run = subject.trace(stream, &mut Scheduling::default())?;
        (rays, seconds) = (rays + f64::from(run.report.rays), seconds + run.report.makespan_s);
    }
    // Several devices share these rays, and are measured one after the other.
    Ok(rays / seconds / devices.len() as f64)
}

/// Rounds for which a picture must be small enough: one that is not counted, and three that are.
const ROUNDS: f64 = 4.0;

/// The least size that is measured, however short the time: sixteen tasks of 256 rays.
const LEAST_PIXELS: f64 = 4096.0;

/// The size of picture, `most` or the same form smaller, of which [`ROUNDS`] fit into the time; a round takes
/// `seconds_per_pixel` for each pixel.
fn size_within(time: Duration, seconds_per_pixel: f64, most: [u32; 2]) -> [u32; 2] {
    let all = most.map(f64::from).iter().product::<f64>();
    let fit = (time.as_secs_f64() / (ROUNDS * seconds_per_pixel)).max(LEAST_PIXELS);
    let scale = (fit / all).min(1.0).sqrt();
    // Whole tiles of eight pixels, as tasks are made of.
    most.map(|side| ((f64::from(side) * scale / 8.0).round() as u32 * 8).clamp(8, side.max(8)))
}

fn finish(lab: Lab<'_>, page: &Page, out: &Path, begin: Instant) -> Result<()> {
    page.write(&out.join(PAGE))?;
    let all = table::seconds(begin.elapsed().as_secs_f64());
    let out = out.display();
    Ok(lab
        .show
        .print(&format!("\n  measured in {all}, written to {out}: tables, charts, raw numbers and report.html"))?)
}

/// Measures the trade of precisions alone, which has options of its own.
///
/// # Errors
/// When a scene cannot be prepared, a device not be opened or fails, or a file not be written.
pub fn run_precision(lab: Lab<'_>, own: &precision::Options) -> Result<()> {
    let begin = Instant::now();
    let trades: Vec<&Trade> = TRADES.iter().filter(|trade| trade.name == "precision").collect();
    let outputs = outputs(&own.out, &trades, &own.scenes)?;
    let lab = lab.writing(&outputs);
    let seeds = format!("Seed {} of the rays.", own.seed);
    let devices = Opener::new().open_in_turn(&own.devices).context("--devices")?;
    let provenance = precision::provenance(own, &devices);
    let mut page = Page::new(TITLE, &provenance, &seeds);
    let time = TimeBudget::whole(lab.show, None);
    precision::run(lab, own, &devices, &time, &mut page)?;
    time.finish();
    finish(lab, &page, &own.out, begin)
}

/// The precision trade as one of all.
fn precision_of_all(setting: &Setting<'_>, page: &mut Page) -> Result<()> {
    let own = precision::Options { size: Some(setting.size), ..precision::Options::of(setting.args, DEVICE) };
    let devices = Opener::new().open_in_turn(&own.devices).context("--devices")?;
    precision::run(setting.lab, &own, &devices, &setting.time, page)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: `sqrt` forgotten; `min(1.0)` gone; the least size gone.
    #[test]
    fn pictures_are_as_small_as_the_time_demands() {
        let size = |seconds| size_within(Duration::from_secs(seconds), 1e-4, SIZE);
        assert_eq!(size(1000), SIZE, "all of it fits twice");
        let [width, height] = size(60);
        let took = f64::from(width * height) * 1e-4 * ROUNDS;
        assert!((50.0..70.0).contains(&took), "{width} x {height}: {took} s of 60");
        assert_eq!(size(0), [80, 48]);
        assert_eq!(size_within(Duration::ZERO, f64::INFINITY, [64, 64]), [64, 64]);
    }
}
