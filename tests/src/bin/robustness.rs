//! Tries the promises on our devices and on other tracers with the same harness, and writes the tables of
//! docs/results/robustness.md.
//!
//! `cargo run --release -p rt-tests --bin robustness -- --help`:
//! the first device of Vulkan and of wgpu through the system's loader, Embree as the environment variable
//! `RAYBALANCE_EMBREE` or the system has it; what is missing is said and left out. `--only` keeps the tracers whose
//! name contains the word. `--markdown` replaces what the file has between its two marker lines.
//!
//! Every case of every tracer runs in a process of its own, since some tracers abort or hang: that is a result too.
#![forbid(unsafe_code)]

use anyhow::{Context, Result, anyhow};
use backend_cpu::CpuDevice;
use backend_vulkan::{Options as VulkanOptions, VulkanDevice};
use backend_wgpu::{Options as WgpuOptions, WgpuDevice};
use clap::Parser;
use rt_bvh::{Builder, PlocQuality};
use rt_core::{Device, Precision};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::{Stdout, note};
use rt_scene::builtin;
use rt_verify::{Extent, Options, Promise, Subject, Suite, Watch};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fmt::{Display, Write as _};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use std::{fs, thread};

/// Lines between which the tables stand in a Markdown file.
const MARKERS: [&str; 2] = ["<!-- tables of the program `robustness` -->", "<!-- end of tables -->"];

/// Try the promises on our devices and on other tracers with the same harness.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Arguments {
    /// 10^8 rays at closed surfaces, as `raybalance verify --full`
    #[arg(long)]
    full: bool,
    /// Rays of each line about closed surfaces
    #[arg(long, value_name = "N")]
    rays: Option<u32>,
    /// Seed of rays and meshes
    #[arg(long, value_name = "N", default_value_t = Options::default().seed)]
    seed: u32,
    /// Only tracers whose name contains this word
    #[arg(long, value_name = "WORD")]
    only: Option<String>,
    /// Replace what this file has between its two marker lines
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// The longest that one case may take
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    limit: u32,
    // Not for people: how this program calls itself, to try one case of one tracer and print its lines.
    #[arg(long, hide = true, num_args = 2, value_names = ["TRACER", "CASE"])]
    task: Option<Vec<String>>,
}

impl Arguments {
    /// What is tried, with the builder that the command takes by default.
    fn options(&self) -> Options {
        let extent = if self.full { Extent::Full } else { Options::default().extent };
        let builder = Builder::Ploc(PlocQuality::Medium);
        Options { extent, rays: self.rays, seed: self.seed, builder }
    }
}

/// A line of a report, as it comes from another process.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Line {
    case: String,
    what: String,
    promise: u8,
    trials: u64,
    failures: u64,
    bounds: [f64; 2],
    note: String,
    seconds: f64,
}

/// What one tracer did.
#[derive(Debug, Serialize)]
struct Report {
    name: String,
    lines: Vec<Line>,
    /// Cases that ended the process or did not end, and how.
    crashes: Vec<(String, String)>,
}

/// A tracer, and what the tables call it.
struct Contender {
    name: String,
    subject: Subject,
}

fn main() -> ExitCode {
    exit::main(|| run(&Arguments::parse()))
}

/// Every tracer that is here, and why others are not. A process that tries only the tracer `wanted` opens no card for
/// it in vain.
fn contenders(wanted: Option<&str>) -> Result<(Vec<Contender>, Vec<String>)> {
    let cpu = CpuDevice::open_all(&[0])?.pop().context("no CPU device")?;
    let cpu: Arc<dyn Device> = Arc::new(cpu);
    let own =
        |name: String, device: Arc<dyn Device>, precision| Contender { name, subject: Subject::of(device, precision) };
    let mut all: Vec<Contender> = [Precision::Robust, Precision::Double, Precision::Fast]
        .map(|precision| own(format!("CPU, {}", precision.name()), Arc::clone(&cpu), precision))
        .into();
    let mut missing = Vec::new();
    for (api, open) in [("Vulkan", vulkan as fn() -> Opened), ("wgpu", wgpu)] {
        if wanted.is_some_and(|name| !name.starts_with(api)) {
            continue;
        }
        match open() {
            Ok(device) => all.push(own(format!("{api} ({}), robust", device.info().name), device, Precision::Robust)),
            Err(reason) => missing.push(format!("{api}: {reason}")),
        }
    }
    let (peers, mut reasons) = backend_peers::all();
    missing.append(&mut reasons);
    all.extend(peers.into_iter().map(|device| own(device.info().name.clone(), device, Precision::default())));
    Ok((all, missing))
}

/// A device, or why there is none.
type Opened = Result<Arc<dyn Device>, String>;

fn vulkan() -> Opened {
    first(VulkanDevice::enumerate(VulkanOptions::default()).map_err(|e| e.to_string())?)
}

fn wgpu() -> Opened {
    first(WgpuDevice::enumerate(WgpuOptions::default()).map_err(|e| e.to_string())?)
}

/// The first that can be used. One of several alike is enough: software Vulkan is set up as three.
fn first<D: Device + 'static, E: Display>(devices: Vec<Result<D, E>>) -> Opened {
    let mut reason = "no device".to_owned();
    for device in devices {
        match device {
            Ok(device) => return Ok(Arc::new(device)),
            Err(e) => reason = e.to_string(),
        }
    }
    Err(reason)
}

fn run(arguments: &Arguments) -> Result<()> {
    let wanted = arguments.task.as_ref().and_then(|task| task.first()).map(String::as_str);
    let (mut contenders, missing) = contenders(wanted)?;
    if let Some([name, case]) = arguments.task.as_deref() {
        let contender = contenders.iter().find(|c| c.name == *name).with_context(|| format!("no tracer {name}"))?;
        return print_case(&arguments.options(), contender, case);
    }
    missing.iter().for_each(|reason| note(format_args!("left out: {reason}")));
    contenders.retain(|c| arguments.only.as_ref().is_none_or(|word| c.name.contains(word.as_str())));
    let reports = contenders.iter().map(|c| examine(arguments, &c.name)).collect::<Result<Vec<_>, _>>()?;
    let provenance = Provenance::now(arguments.seed, reports.iter().map(|report| report.name.clone()));
    let tables = format!("{provenance}\n{}", tables(&arguments.options(), &reports)?);
    match &arguments.markdown {
        Some(path) => replace(path, &tables)?,
        None => write!(Stdout, "{tables}")?,
    }
    if let Some(path) = &arguments.json {
        let options = arguments.options();
        let all = json!({
            "schema": 2, "provenance": provenance, "extent": options.extent.name(),
            "rays": options.rays, "builder": options.builder.to_string(), "tracers": reports,
        });
        let text = serde_json::to_string_pretty(&all)?;
        fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Tries one case in this process.
fn print_case(options: &Options, contender: &Contender, case: &str) -> Result<()> {
    let suite = Suite::new(*options, vec![builtin::yard(), builtin::car()]);
    let report = suite.run_case(case, &contender.subject, Watch::default())?;
    writeln!(Stdout, "{}", serde_json::to_string(&report.rows)?)?;
    Ok(())
}

/// Tries every case, each in a process of its own.
fn examine(arguments: &Arguments, name: &str) -> Result<Report> {
    let mut report = Report { name: name.to_owned(), lines: Vec::new(), crashes: Vec::new() };
    for case in Suite::case_names() {
        let begin = Instant::now();
        match apart(arguments, name, case)? {
            Ok(mut lines) => report.lines.append(&mut lines),
            Err(how) => report.crashes.push((case.to_owned(), how)),
        }
        note(format_args!("{name}: {case}: {:.1} s", begin.elapsed().as_secs_f64()));
    }
    Ok(report)
}

/// The lines of one case, or how its process ended instead.
fn apart(arguments: &Arguments, name: &str, case: &str) -> Result<Result<Vec<Line>, String>> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(["--task", name, case]).args(["--seed", &arguments.seed.to_string()]);
    if arguments.full {
        command.arg("--full");
    }
    if let Some(rays) = arguments.rays {
        command.args(["--rays", &rays.to_string()]);
    }
    // What a crash has to say is short, and the lines of a case fit into any pipe's reader below.
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn()?;
    let mut pipe = child.stdout.take().context("no pipe to the process")?;
    let reader = thread::spawn(move || {
        let mut text = String::new();
        std::io::Read::read_to_string(&mut pipe, &mut text).map(|_| text)
    });
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if begin.elapsed() > Duration::from_secs(arguments.limit.into()) {
            child.kill().and_then(|()| child.wait())?;
            return Ok(Err(format!("no end after {} s", arguments.limit)));
        }
        thread::sleep(Duration::from_millis(20));
    };
    let text = reader.join().map_err(|_| anyhow!("the reader of a pipe panicked"))??;
    if !status.success() {
        return Ok(Err(format!("the process ended: {status}")));
    }
    serde_json::from_str(&text).map(Ok).with_context(|| format!("{name}, {case}"))
}

/// Puts the tables between the markers of a file.
fn replace(path: &PathBuf, tables: &str) -> Result<()> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let missing = || format!("{}: the lines `{}` and `{}` are missing", path.display(), MARKERS[0], MARKERS[1]);
    let (before, rest) = text.split_once(MARKERS[0]).with_context(missing)?;
    let (_, after) = rest.split_once(MARKERS[1]).with_context(missing)?;
    let text = format!("{before}{}\n{tables}{}{after}", MARKERS[0], MARKERS[1]);
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

fn tables(options: &Options, reports: &[Report]) -> Result<String> {
    let mut text = String::new();
    let write = |text: &mut String| -> std::fmt::Result {
        writeln!(text, "\nSuite: {}, seed {}, trees by {}.\n", options.extent.name(), options.seed, options.builder)?;
        header(text, "promise", reports)?;
        for promise in Promise::ALL {
            write!(text, "| {promise} {} |", promise.text())?;
            reports.iter().try_for_each(|report| write!(text, " {} |", total(report, promise)))?;
            writeln!(text)?;
        }
        writeln!(text, "\nFailures per million, line by line; `·` is none, `–` was not tried.\n")?;
        header(text, "line", reports)?;
        let Some(first) = reports.first() else { return Ok(()) };
        for line in &first.lines {
            write!(text, "| {}: {} |", line.case, line.what)?;
            reports.iter().try_for_each(|report| write!(text, " {} |", cell(report, line)))?;
            writeln!(text)?;
        }
        writeln!(text, "\nCases that a tracer did not survive, and the first failure of each promise not kept:\n")?;
        for report in reports {
            for (case, how) in &report.crashes {
                writeln!(text, "* {}, {case}: {how}", report.name)?;
            }
            for promise in Promise::ALL {
                let broken = |line: &&Line| line.promise == promise.number() && line.failures > 0;
                if let Some(line) = report.lines.iter().find(broken) {
                    writeln!(
                        text,
                        "* {}, promise {promise}, {}, {}: `{}`",
                        report.name, line.case, line.what, line.note
                    )?;
                }
            }
        }
        writeln!(text)
    };
    write(&mut text)?;
    Ok(text)
}

fn header(text: &mut String, first: &str, reports: &[Report]) -> std::fmt::Result {
    let names: Vec<&str> = reports.iter().map(|report| report.name.as_str()).collect();
    writeln!(text, "| {first} | {} |", names.join(" | "))?;
    writeln!(text, "|---|{}", "---|".repeat(names.len()))
}

/// Failures, trials and the bounds of the rate, of all lines of a promise.
fn total(report: &Report, promise: Promise) -> String {
    let lines = report.lines.iter().filter(|line| line.promise == promise.number());
    let (failures, trials) = lines.fold((0, 0), |(f, t), line| (f + line.failures, t + line.trials));
    if trials == 0 {
        return "–".to_owned();
    }
    let [low, high] = rt_verify::stats::clopper_pearson(failures, trials).map(|rate| 1e6 * rate);
    let ended = match report.crashes.len() {
        // A process that ends or hangs breaks the promise about meshes, whatever was tried.
        n if n > 0 && promise == Promise::AnyMesh => format!(", **{n} cases ended the process**"),
        _ => String::new(),
    };
    match failures {
        0 => format!("0 of {} (≤ {} ppm){ended}", short(trials as f64), short(high)),
        _ => format!("**{failures}** of {} ({} – {} ppm){ended}", short(trials as f64), short(low), short(high)),
    }
}

fn cell(report: &Report, line: &Line) -> String {
    if report.crashes.iter().any(|(case, _)| *case == line.case) {
        return "ended".to_owned();
    }
    match report.lines.iter().find(|other| (&other.case, &other.what) == (&line.case, &line.what)) {
        Some(line) if line.failures > 0 => short(1e6 * line.failures as f64 / line.trials.max(1) as f64),
        Some(line) if line.trials > 0 => "·".to_owned(),
        _ => "–".to_owned(),
    }
}

/// Three digits, with k and M for thousands and millions.
fn short(x: f64) -> String {
    let digits = |x: f64, unit: &str| match x {
        x if x >= 99.95 => format!("{x:.0}{unit}"),
        x if x >= 9.995 => format!("{x:.1}{unit}"),
        x => format!("{x:.2}{unit}"),
    };
    match x {
        x if x >= 999_500.0 => digits(x / 1e6, " M"),
        x if x >= 9_995.0 => digits(x / 1e3, " k"),
        x if x >= 0.0095 || x == 0.0 => digits(x, ""),
        x => format!("{x:.1e}"),
    }
}
