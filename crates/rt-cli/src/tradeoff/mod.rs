//! `raybalance tradeoff`: what speed costs in accuracy, measured.

mod build;
mod precision;
mod sampling;
mod streams;

use crate::args::{PrecisionTradeoffArgs, TradeArg, TradeArgs, TradeoffArgs};
use crate::experiment::{Machine, command_line};
use crate::html::Page;
use crate::output::write_atomically;
use crate::{devices, interrupt, progress};
use anyhow::{Result, bail};
use indicatif::ProgressBar;
use rt_core::Device;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Something to be traded, such as samples for accuracy.
struct Trade {
    name: &'static str,
    /// Share of the budget, relative to the other trades'.
    weight: f64,
    run: fn(&Setting<'_>, &mut Page) -> Result<()>,
}

/// Every trade there is, in the order in which `raybalance tradeoff` runs them.
const TRADES: [Trade; 3] = [
    // Hundreds of settings against seven.
    Trade { name: "sampling", weight: 4.0, run: sampling::run },
    Trade { name: "precision", weight: 1.0, run: precision_of_all },
    Trade { name: "build", weight: 1.0, run: build::run },
];

const TITLE: &str = "Speed against accuracy";

/// Budget of all trades together.
const ALL_TRADES: Duration = Duration::from_secs(600);

/// As for figure 1: see there.
const SIZE: [u32; 2] = [1024, 640];
const QUICK_SIZE: [u32; 2] = [320, 200];
const REPEAT: u32 = 9;
const QUICK_REPEAT: u32 = 2;

/// How the trades are measured.
struct Setting<'a> {
    args: &'a TradeArgs,
    devices: &'a [Arc<dyn Device>],
    size: [u32; 2],
    repeat: u32,
    /// When no further round is begun.
    until: Option<Instant>,
    head: Head,
}

/// What every file says of its origin.
#[derive(Clone, Debug, Serialize)]
struct Head {
    /// Layout of the file; changes when a field changes its meaning or goes away.
    schema: u32,
    command: String,
    machine: Machine,
    device: String,
    size: [u32; 2],
    seed: u32,
}

pub(crate) fn run(args: &TradeoffArgs) -> Result<()> {
    interrupt::watch();
    if let Some(TradeArg::Precision(own)) = &args.trade {
        let seeds = format!("Seed {} of the rays.", own.seed);
        let mut page = Page::new(TITLE, &command_line(), &Machine::this(), &seeds);
        precision::run(own, None, &mut page)?;
        return finish(&page, &own.out);
    }
    let (common, chosen) = match &args.trade {
        None | Some(TradeArg::Precision(_)) => (&args.common, None),
        Some(TradeArg::Sampling(common)) => (common, Some("sampling")),
        Some(TradeArg::Build(common)) => (common, Some("build")),
    };
    let devices = devices::open(Some(&common.device))?;
    let [device] = &devices[..] else { bail!("--device {}: name one device, such as cpu:1", common.device) };
    let size = common.size.unwrap_or(if common.quick { QUICK_SIZE } else { SIZE });
    let head = Head {
        schema: 1,
        command: command_line(),
        machine: Machine::this(),
        device: device.info().name.clone(),
        size,
        seed: common.seed,
    };
    let budget = common.budget.map(|seconds| Duration::from_secs(seconds.into()));
    let budget = budget.or(chosen.is_none().then_some(ALL_TRADES));
    let seeds =
        format!("Seed {} of pixels, bounces and samples; those of each round are in the JSON files.", common.seed);
    let mut page = Page::new(TITLE, &head.command, &head.machine, &seeds);
    let trades: Vec<&Trade> = TRADES.iter().filter(|trade| chosen.is_none_or(|name| name == trade.name)).collect();
    let begin = Instant::now();
    let all: f64 = trades.iter().map(|trade| trade.weight).sum();
    let mut share = 0.0;
    for trade in trades {
        // What a trade leaves of its share goes to those after it.
        share += trade.weight / all;
        let setting = Setting {
            args: common,
            devices: &devices,
            size,
            repeat: common.repeat.unwrap_or(if common.quick { QUICK_REPEAT } else { REPEAT }),
            until: budget.map(|budget| begin + budget.mul_f64(share)),
            head: head.clone(),
        };
        (trade.run)(&setting, &mut page)?;
    }
    finish(&page, &common.out)
}

fn finish(page: &Page, out: &Path) -> Result<()> {
    page.write(&out.join("report.html"))?;
    println!("\n  written to {}: tables, charts, raw numbers and report.html", out.display());
    Ok(())
}

/// The precision trade as one of all.
fn precision_of_all(setting: &Setting<'_>, page: &mut Page) -> Result<()> {
    let budget = setting.until.map(|until| until.saturating_duration_since(Instant::now()));
    precision::run(&PrecisionTradeoffArgs::of(setting.args), budget, page)
}

impl Setting<'_> {
    /// The rounds that may still be begun, the first of which is not counted and the second always measured.
    fn rounds(&self) -> impl Iterator<Item = u32> {
        (0..=self.repeat).take_while(|&round| round < 2 || self.until.is_none_or(|until| Instant::now() < until))
    }

    /// A progress bar for `steps` of each round.
    fn bar(&self, label: &'static str, steps: usize) -> ProgressBar {
        progress::bar(label, steps as u64 * (u64::from(self.repeat) + 1))
    }

    /// Writes a text file into the output folder.
    fn write(&self, name: &str, text: &str) -> Result<()> {
        write_atomically(&self.args.out.join(name), |out| Ok(out.write_all(text.as_bytes())?))
    }

    /// Writes a JSON file: the head, and what was measured.
    fn write_json(&self, name: &str, results: &impl Serialize) -> Result<()> {
        #[derive(Serialize)]
        struct File<'a, T> {
            #[serde(flatten)]
            head: &'a Head,
            results: &'a T,
        }
        let file = File { head: &self.head, results };
        write_atomically(&self.args.out.join(name), |out| Ok(serde_json::to_writer_pretty(out, &file)?))
    }

    /// Lines that open a CSV file.
    fn csv_head(&self) -> String {
        let Head { command, machine, device, .. } = &self.head;
        format!("# command: {command}\n# machine: {machine}\n# measured on: {device}\n")
    }
}

/// A scene's name as part of a file's.
fn file_part(scene: &str) -> String {
    Path::new(scene).file_name().map_or_else(|| "scene".to_owned(), |name| name.to_string_lossy().replace(' ', "-"))
}
