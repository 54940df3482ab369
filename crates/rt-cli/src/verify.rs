//! `raybalance verify`: the promises about hits, tried on the devices of this machine.

use crate::args::{DeviceArgs, VerifyArgs};
use crate::table::seconds;
use crate::{interrupt, progress, scene};
use anyhow::{Result, bail};
use rt_lab::verify::{self, Report, SCHEMA};
use rt_report::Provenance;
use rt_report::print::Stdout;
use rt_verify::{Extent, Options, Promise, Subject, Suite, Verdict, Watch};
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

/// Scenes that are tried where none are named.
const SCENES: [&str; 2] = ["yard", "car"];

/// Steps of the progress bar.
const STEPS: f64 = 1000.0;

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
        let subject = Subject::of(device, args.precision.into());
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
            write!(Stdout, "{}", verify::text(report))?;
        }
        writeln!(Stdout, "\n  {} in all, seed {}", seconds(total), args.seed)?;
    }
    let failed: usize = reports.iter().map(|report| report.count(Verdict::Fail)).sum();
    if failed > 0 {
        bail!("{failed} lines failed: not every promise was kept");
    }
    Ok(())
}
