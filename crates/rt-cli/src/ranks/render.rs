//! `raybalance render` by several processes: each renders tiles, rank 0 gathers and writes them.

use super::{explained, warn};
use crate::args::RenderArgs;
use crate::memory::{self, BYTES_PER_PATH, Room};
use crate::output::Outputs;
use crate::render::{self, Source, Stage};
use crate::report::{Report, SCHEMA, SceneReport};
use crate::{interrupt, progress, table};
use anyhow::{Result, bail};
use rt_cluster::{Checkpoint, Deal, Finished, Heard, Ranks, Relay, Transport, deal};
use rt_render::tiles::{self, FrameTiles, fingerprint, fingerprint_of_scene};
use rt_render::{Film, Session, Subject, Traced};
use rt_report::chart::trace::{self, Timeline};
use rt_report::headline::Headline;
use rt_report::pictures::Part;
use rt_report::print::Stdout;
use rt_report::usage::usage;
use rt_report::{Provenance, charts, terminal};
use rt_scene::streams::Waves;
use std::io::{self, Write};
use std::time::Instant;

/// For so many processes pictures with a checkpoint are cut, since any number of them may go on with it.
const ANY_RANKS: u32 = 16;

/// Renders this process's part; whether all processes are there still.
pub(crate) fn run(args: &RenderArgs, ranks: &mut Ranks) -> Result<bool> {
    let start = Instant::now();
    let scheduling = args.balance.scheduling()?;
    if args.reference {
        bail!(usage("--reference measures the devices of one process: leave it out where several work together"));
    }
    if args.time.is_some() {
        bail!(usage("--time is for one process: leave it out where several work together"));
    }
    let is_first = ranks.rank() == 0;
    // Shards would write it to one folder.
    let timelines = args.shard.is_none().then(|| "trace.json".to_owned());
    let files: Vec<String> = timelines.iter().cloned().chain([charts::report_name(args.shard)]).collect();
    let outputs = is_first.then(|| render::outputs(args, &files));
    let mut relay = super::relay(ranks)?;
    if is_first || !args.broadcast {
        render::check(args, outputs.as_ref())?;
    }
    let tiles = cut(args, ranks)?;
    let (source, described) = source(args, outputs.as_ref(), &mut relay)?;
    let Stage { devices, balancer, motion, mut renderer, mut animation, begin_s, mut seconds } =
        Stage::set(args, &scheduling.limits, source)?;
    let mut runs = Vec::new();
    let mut record = |traced: Traced<'_>| runs.push(traced.run);
    let mut session = Session { balancer, scheduling, show: &|_| {}, record: &mut record };
    let mut scene = fingerprint_of_scene(&renderer);
    let mut film = Film::new(if is_first { args.size } else { [1, 1] })?;
    let mut pictures = render::pictures(args, &renderer, &motion)?;
    // Only rank 0 knows which frames are whole, and which are those of a shard.
    let mut part = if is_first { render::part(args, &pictures) } else { Part::default() };
    if is_first {
        relay.tell(&part.missing).map_err(explained)?;
    } else {
        part.missing = relay.hear().map_err(explained)?;
    }
    let provenance = Provenance::of(args.balance.seed, &devices);
    let (mut reports, mut is_complete) = (Vec::new(), true);
    // Of each tile, in the frame before.
    let mut before: Option<Vec<f32>> = None;
    for &frame in &part.missing {
        if animation.show(frame, &mut renderer, &mut session)? {
            scene = fingerprint_of_scene(&renderer);
        }
        let paths = renderer.paths(motion.camera(frame)?, frame);
        let count = u32::try_from(tiles.count())?;
        let about = Deal {
            round: frame,
            prices: before.as_deref(),
            cancel: Some(interrupt::flag()),
            ..Deal::new(count, fingerprint(scene, &renderer, &paths, &tiles))
        };
        let mut took = vec![0.0; count as usize];
        let bar = progress::bar("rendering", count.into());
        let mut gather = |Finished { tile, seconds, bytes }: Finished<'_>| {
            let pixels = tiles.wave(tile.into()).pixels;
            film.take(&pixels, &tiles::unpack(tile, pixels.len(), bytes).map_err(io::Error::other)?, args.spp);
            took[tile as usize] = seconds;
            bar.inc(1);
            Ok(())
        };
        let kept = args.checkpoint.as_ref().filter(|_| is_first).map(|folder| {
            let file = folder.join(format!("frame-{frame:04}.tiles"));
            Checkpoint::open(&file, about.fingerprint, count, &mut gather)
        });
        let (mut checkpoint, finished) = kept.transpose()?.unzip();
        let finished = finished.unwrap_or_default();
        let about = Deal { finished: &finished, ..about };
        let mut take = |done: Finished<'_>| {
            gather(done)?;
            checkpoint.as_mut().map_or(Ok(()), |checkpoint: &mut Checkpoint| checkpoint.add(done))
        };
        let mut job = FrameTiles { renderer: &renderer, session: &mut session, paths: &paths, frame, tiles };
        let dealt = deal(&mut relay, &about, &mut job, &mut take);
        bar.finish_and_clear();
        let dealt = dealt.map_err(explained)?;
        is_complete &= dealt.is_complete;
        let tiles_s: f32 = took.iter().sum();
        before = Some(took);
        if let Some(report) = dealt.report {
            warn(&report);
            seconds.trace += report.makespan_s;
            render::write(&mut pictures, &film, frame)?;
            // What those who were at it before have done counts too.
            let busy_s: f64 = report.ranks.iter().map(|rank| rank.busy_s).sum();
            let before_s = (f64::from(tiles_s) - busy_s).max(0.0) / f64::from(relay.size());
            pictures.note(frame, report.makespan_s + before_s, &provenance)?;
            reports.push(report);
        }
    }
    interrupt::check()?;
    let Session { scheduling, .. } = session;
    let timeline = Timeline::of(relay.rank(), &runs, begin_s);
    let heard = if is_first {
        let lost = |rank: &u32| reports.last().is_some_and(|last| last.ranks[*rank as usize].lost.is_some());
        let others: Vec<u32> = (1..relay.size()).filter(|rank| !lost(rank)).collect();
        relay.ask(&others, &rt_balance::clock).map_err(explained)?
    } else {
        relay.answer(&serde_json::to_vec(&timeline)?, &rt_balance::clock).map_err(explained)?;
        Vec::new()
    };
    if let Some(described) = described.filter(|_| is_first) {
        pictures.write_sheet()?;
        if part.missing.is_empty() {
            return Ok(is_complete);
        }
        seconds.write += pictures.seconds;
        seconds.add_updates(animation.updates());
        seconds.total = start.elapsed().as_secs_f64();
        let heard: Vec<Heard> = heard.into_iter().flatten().collect();
        if let Some(name) = timelines {
            let timelines = Timeline::together(timeline, begin_s, &heard);
            trace::write_timelines(&args.out.join(name), &timelines, &provenance)?;
        }
        let report = Report {
            schema: SCHEMA,
            provenance,
            picture: Some(render::picture_report(args, &pictures, &part, &motion, &described)),
            scene: described,
            queue: scheduling.queue.name(),
            policy: scheduling.policy_name(),
            streams: runs.into_iter().map(|run| run.report).collect(),
            headline: Headline::of_processes(&reports),
            updates: animation.updates().to_vec(),
            cluster: reports,
            seconds,
        };
        report.write(&args.out, args.shard)?;
        if args.json {
            writeln!(Stdout, "{}", serde_json::to_string_pretty(&report)?)?;
        } else {
            let width = terminal::columns();
            write!(Stdout, "{}", terminal::scene(&report, width))?;
            writeln!(Stdout, "\n{}", terminal::ranks(&report.cluster, width).trim_end())?;
            write!(Stdout, "{}", terminal::updates(&report, width))?;
            writeln!(Stdout, "  wall: {} in total", table::seconds(report.seconds.total))?;
            writeln!(Stdout, "  written to {}: image, {}", args.out.display(), files.join(", "))?;
            write!(Stdout, "\n{}", terminal::headline(&report, width))?;
        }
    }
    Ok(is_complete)
}

/// The scene, and on rank 0 what is told of it: prepared by each rank, or by rank 0 for all.
fn source(
    args: &RenderArgs,
    outputs: Option<&Outputs>,
    relay: &mut Relay<'_>,
) -> Result<(Source, Option<SceneReport>)> {
    let begin = Instant::now();
    if args.broadcast && relay.rank() > 0 {
        let (subject, view) = Subject::receive(relay)?;
        return Ok((Source { subject, view, took_s: [begin.elapsed().as_secs_f64(), 0.0], wind: None }, None));
    }
    let prepared = Source::prepare(args, outputs);
    match &prepared {
        Ok((Source { subject, view, .. }, _)) if args.broadcast => subject.send(view, relay).map_err(explained)?,
        Err(_) if args.broadcast => Subject::give_up(relay).map_err(explained)?,
        _ => {}
    }
    let (source, described) = prepared?;
    Ok((source, Some(described)))
}

/// Cuts the picture into tiles. Free memory does not decide how: it differs between machines, the cut must not.
fn cut(args: &RenderArgs, ranks: &Ranks) -> Result<Waves> {
    let waves = Waves::new(args.size, args.spp, BYTES_PER_PATH, args.memory)?;
    let tiles = tiles::cut(waves, args.spp, args.checkpoint.as_ref().map_or(ranks.size(), |_| ANY_RANKS));
    let tile = tiles.largest() * u64::from(args.spp) * BYTES_PER_PATH;
    let picture = if ranks.rank() == 0 { tiles.pixels() * Film::BYTES_PER_PIXEL } else { 0 };
    let what = format!("a picture of {} pixels in tiles of {}", tiles.pixels(), memory::size(tile));
    Room::now().require(picture + tile, &what, "choose a smaller --memory or --size")?;
    Ok(tiles)
}
