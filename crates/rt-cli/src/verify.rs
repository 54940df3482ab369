//! `raybalance verify`: the promises about hits, tried on the devices of this machine.

use crate::args::{DeviceArgs, VerifyArgs};
use crate::table::{Table, grouped, seconds};
use crate::{interrupt, progress, scene};
use anyhow::{Result, bail};
use rt_report::Provenance;
use rt_report::print::Stdout;
use rt_verify::{DeviceReport, Extent, Options, Promise, Row, Subject, Suite, Verdict, Watch};
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

/// Scenes that are tried where none are named.
const SCENES: [&str; 2] = ["yard", "car"];

/// Steps of the progress bar.
const STEPS: f64 = 1000.0;

/// What `--json` prints; `docs/verify.md` describes it.
#[derive(Debug, Serialize)]
struct Report<'a> {
    schema: u32,
    provenance: Provenance,
    extent: &'static str,
    builder: String,
    scenes: Vec<String>,
    promises: Vec<(u8, &'static str)>,
    devices: &'a [DeviceReport],
    seconds: f64,
}

/// Version of the report's layout.
const SCHEMA: u32 = 2;

pub(crate) fn run(args: &VerifyArgs) -> Result<()> {
    let begin = Instant::now();
    let names = if args.scenes.is_empty() { SCENES.map(PathBuf::from).to_vec() } else { args.scenes.clone() };
    scene::check(&names)?;
    let models = names.iter().map(|name| scene::load(name)).collect::<Result<Vec<_>>>()?;
    let devices = DeviceArgs::default().open(Some(&args.devices))?;
    let extent = if args.full { Extent::Full } else { Extent::Quick };
    let suite = Suite::new(Options { extent, rays: args.rays, seed: args.seed, builder: args.builder }, models);

    let bar = progress::bar("verifying", (STEPS * devices.len() as f64) as u64);
    let mut reports = Vec::new();
    for (i, device) in devices.into_iter().enumerate() {
        let subject = Subject::new(device, args.precision.into());
        let show = |share: f64, _: &str| bar.set_position((STEPS * (i as f64 + share)) as u64);
        let watch = Watch { stop: Some(interrupt::flag()), progress: Some(&show) };
        reports.push(match &args.cases[..] {
            [] => suite.run(&subject, watch)?,
            cases => suite.run_cases(cases, &subject, watch)?,
        });
    }
    bar.finish_and_clear();

    let total = begin.elapsed().as_secs_f64();
    if args.json {
        let report = Report {
            schema: SCHEMA,
            provenance: Provenance::now(args.seed, reports.iter().map(|report| report.device.clone())),
            extent: extent.name(),
            builder: args.builder.to_string(),
            scenes: names.iter().map(|name| name.display().to_string()).collect(),
            promises: Promise::ALL.map(|promise| (promise.number(), promise.text())).to_vec(),
            devices: &reports,
            seconds: total,
        };
        writeln!(Stdout, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        for report in &reports {
            print(report)?;
        }
        writeln!(Stdout, "\n  {} in all, seed {}", seconds(total), args.seed)?;
    }
    let failed: usize = reports.iter().map(|report| report.count(Verdict::Fail)).sum();
    if failed > 0 {
        bail!("{failed} lines failed: not every promise was kept");
    }
    Ok(())
}

fn print(report: &DeviceReport) -> Result<()> {
    writeln!(Stdout, "{} ({}), precision {}\n", report.device, report.backend, report.precision)?;
    let mut table = Table::new(&["case", "what", "promise", "tried", "failed", "ppm", "95% bounds", "verdict"]);
    for row in &report.rows {
        table.row(vec![
            row.case.to_owned(),
            row.what.clone(),
            row.promise.to_string(),
            grouped(row.trials),
            grouped(row.failures),
            ppm(row.rate),
            bounds(row),
            verdict(row),
        ]);
    }
    writeln!(Stdout, "{table}")?;
    for row in report.rows.iter().filter(|row| row.verdict == Verdict::Fail) {
        writeln!(Stdout, "  FAIL {}, {}: {}", row.case, row.what, row.note)?;
    }
    for promise in Promise::ALL {
        let rows: Vec<&Row> = report.rows.iter().filter(|row| row.promise == promise).collect();
        let failed = rows.iter().filter(|row| row.verdict == Verdict::Fail).count();
        let (failures, trials) = report.of(promise);
        let state = match () {
            () if failed > 0 => format!("BROKEN: {} of {} trials failed", grouped(failures), grouped(trials)),
            () if trials > 0 => format!("kept in {} trials", grouped(trials)),
            () => elsewhere(promise).to_owned(),
        };
        writeln!(Stdout, "  promise {promise:>2}, {}: {state}", promise.text())?;
    }
    let [passed, failed, skipped] = [Verdict::Pass, Verdict::Fail, Verdict::Skipped].map(|v| report.count(v));
    writeln!(Stdout, "\n  {passed} passed, {failed} failed, {skipped} skipped")?;
    Ok(())
}

/// Who measures what this suite does not.
const fn elsewhere(promise: Promise) -> &'static str {
    match promise {
        Promise::PriceOfRobustness => "not tried here: `raybalance tradeoff precision` measures it",
        Promise::EstimateCoverage => "not tried here: it is about estimates, not hits",
        _ => "not tried",
    }
}

fn ppm(rate: f64) -> String {
    match 1e6 * rate {
        0.0 => "0".to_owned(),
        ppm if ppm >= 100.0 => grouped(ppm.round() as u64),
        ppm => format!("{ppm:.2}"),
    }
}

fn bounds(row: &Row) -> String {
    match row.verdict {
        Verdict::Skipped => "–".to_owned(),
        _ => format!("{} – {}", ppm(row.bounds[0]), ppm(row.bounds[1])),
    }
}

fn verdict(row: &Row) -> String {
    match row.verdict {
        Verdict::Pass if row.note.is_empty() => "pass".to_owned(),
        Verdict::Pass => format!("pass: {}", row.note),
        Verdict::Fail => "FAIL".to_owned(),
        Verdict::Skipped => format!("skipped: {}", row.note),
    }
}
