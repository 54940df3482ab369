//! `raybalance trace`: rays from a NumPy file, hits to another.

use crate::args::TraceArgs;
use crate::memory::{self, BYTES_PER_GIVEN_RAY, Room};
use crate::output::Outputs;
use crate::ranks;
use crate::report::{Report, SCHEMA, SceneReport, Seconds};
use crate::{interrupt, progress, scene, table};
use anyhow::{Context, Result};
use rt_balance::{Balancer, Control, Stream};
use rt_cluster::{Relay, Transport};
use rt_core::{Hit, Query, RaySource, StreamKind, StreamSpec, TestCounts};
use rt_render::ranges::RayRanges;
use rt_report::headline::Headline;
use rt_report::npy;
use rt_report::print::Stdout;
use rt_report::{Provenance, terminal};
use rt_scene::npy::RayFile;
use std::io::Write;
use std::sync::Arc;
use std::time::Instant;

pub(crate) fn run(args: &TraceArgs) -> Result<()> {
    let mut ranks = ranks::join()?;
    let traced = ranks::relay(&mut ranks).and_then(|mut relay| trace(args, &mut relay));
    if ranks.size() == 1 { traced.map(|_| ()) } else { ranks::leave(ranks, traced) }
}

/// Traces, with others if there are any; whether those are there still.
fn trace(args: &TraceArgs, relay: &mut Relay<'_>) -> Result<bool> {
    let start = Instant::now();
    let mut scheduling = args.balance.scheduling()?;
    let mut outputs = Outputs::new().file("--hits", &args.hits).scenes([&args.scene]).input("the rays", &args.rays);
    if let Some(counts) = &args.counts {
        outputs = outputs.file("--counts", counts);
    }
    scene::check([&args.scene])?;
    // Only rank 0 writes.
    let is_first = relay.rank() == 0;
    if is_first {
        outputs.check()?;
    }
    let rays = RayFile::open(&args.rays)?;
    let most = rays.most_rays();
    let what = format!("{}: tracing {most} rays", args.rays.display());
    Room::now().require(most.saturating_mul(BYTES_PER_GIVEN_RAY), &what, "split the file")?;
    let prepared = args.source.prepare(&args.scene)?;
    outputs.spare_materials(&prepared.libraries)?;
    let begin = Instant::now();
    let rays = rays.read(prepared.model.offset)?;
    let load_s = prepared.load_s + begin.elapsed().as_secs_f64();
    let scene = Arc::clone(&prepared.built.scene);
    let devices = args.balance.device.open(args.balance.devices.as_deref())?;
    let begin = Instant::now();
    let mut balancer = Balancer::open(Arc::clone(&scene), &devices, &scheduling.limits, interrupt::control())?;
    let setup_s = begin.elapsed().as_secs_f64();

    let query = if args.any { Query::Any } else { Query::Closest };
    let spec = StreamSpec::new(query, prepared.precision, args.counts.is_some());
    let count = u32::try_from(rays.len()).with_context(|| format!("{}: more than 2^32 rays", args.rays.display()))?;
    let mut hits = memory::filled(Hit::MISS, count as usize, "the hits")?;
    let counts = args.counts.as_ref().map(|_| memory::filled(TestCounts::default(), count as usize, "the counts"));
    let mut counts = counts.transpose()?;
    let mut report = None;
    let (mut runs, mut is_complete) = (Vec::new(), true);
    if relay.size() > 1 {
        let job = RayRanges {
            rays: &rays,
            scene: &scene,
            spec,
            seed: args.balance.seed,
            cut: args.balance.cut(),
            balancer: &mut balancer,
            scheduling: &mut scheduling,
            runs: &mut runs,
            control: interrupt::control(),
            ranges: RayRanges::count(count, relay.size()),
        };
        (is_complete, report) = ranks::trace::run(job, relay, &mut hits, counts.as_deref_mut())?;
        if !is_first {
            return Ok(is_complete);
        }
    } else {
        let source = RaySource::Explicit { rays: rays.into(), origins: None };
        let stream = args.balance.cut().of(Stream::new(source, StreamKind::Custom, spec), devices.len());
        let stream = Stream { seed: args.balance.seed, ..stream };
        let show = progress::of_streams("tracing");
        let control = Control { progress: Some(&show), ..interrupt::control() };
        let run = balancer.trace(&stream, &mut scheduling, &mut hits, counts.as_deref_mut(), control);
        show(count.into(), count.into());
        runs.push(run?);
    }

    let begin = Instant::now();
    npy::write_hits(&args.hits, &hits)?;
    if let (Some(path), Some(counts)) = (&args.counts, &counts) {
        npy::write_counts(path, counts)?;
    }
    let estimate: f64 = runs.iter().map(|run| run.report.estimate.seconds).sum();
    let traced: f64 = runs.iter().map(|run| run.report.makespan_s).sum();
    let seconds = Seconds {
        load: load_s,
        build: prepared.build_s,
        setup: setup_s,
        estimate,
        trace: report.as_ref().map_or(traced - estimate, |report| report.makespan_s),
        write: begin.elapsed().as_secs_f64(),
        total: start.elapsed().as_secs_f64(),
        ..Seconds::default()
    };
    if let Some(report) = &report {
        ranks::trace::tell(report, args.json)?;
    }
    if args.json {
        let report = Report {
            schema: SCHEMA,
            provenance: Provenance::of(args.balance.seed, &devices),
            scene: SceneReport::of(&prepared),
            picture: None,
            queue: scheduling.queue.name(),
            policy: scheduling.policy_name(),
            headline: report
                .as_ref()
                .map_or_else(|| Headline::of(&runs), |report| Headline::of_processes(std::slice::from_ref(report))),
            streams: runs.into_iter().map(|run| run.report).collect(),
            updates: Vec::new(),
            cluster: report.into_iter().collect(),
            seconds,
        };
        writeln!(Stdout, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        if report.is_none() {
            if args.balance.explain {
                write!(Stdout, "{}", terminal::reasons(&runs, terminal::columns()))?;
            }
            write!(Stdout, "{}", terminal::streams(&runs, terminal::columns()))?;
        }
        let met = hits.iter().filter(|hit| hit.is_hit()).count();
        writeln!(Stdout, "\n  {} of {} rays hit", table::grouped(met as u64), table::grouped(count.into()))?;
    }
    Ok(is_complete)
}
