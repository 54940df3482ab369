//! `raybalance render`: a picture, and how well the work was balanced.

use crate::args::RenderArgs;
use crate::memory::{PictureNeeds, Room};
use crate::output::Outputs;
use crate::ranks::{self, Ranks};
use crate::report::{CameraReport, PictureReport, Report, SCHEMA, SceneReport, Seconds};
use crate::{chart, html, interrupt, output, progress, scene};
use anyhow::{Context, Result};
use rt_balance::report::StreamRun;
use rt_balance::{Balancer, Limits};
use rt_core::Device;
use rt_render::{Animation, Film, Frame, Passes, Progress, Renderer, Session, Traced};
use rt_report::chart::cost::{self, CostMap, CostMaps};
use rt_report::headline::Headline;
use rt_report::pictures::Pictures;
use rt_report::print::{Stdout, note};
use rt_report::usage::{OrUsage, usage};
use rt_report::{Provenance, tasks, terminal};
use rt_scene::prepare::Prepared;
use rt_scene::streams::Paths;
use rt_scene::wind::Wind;
use rt_scene::{Model, View, view};
use std::cell::Cell;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What is written beside pictures, and what it is.
const FILES: [(&str, &str); 6] = [
    ("cost.png", "estimated beside measured cost of each part of the picture"),
    ("timeline.svg", "what each device did when"),
    ("trace.json", "the same for Perfetto or chrome://tracing, to zoom into"),
    ("report.json", "all numbers"),
    ("tasks.csv", "the numbers of every task"),
    ("report.html", "this page"),
];

/// The orbit's angle between two frames unless another is asked for: a slow turn, so that the previous frame says much
/// about the next.
const ORBIT_STEP_DEGREES: f32 = 1.0;

fn degrees_per_frame(args: &RenderArgs) -> f32 {
    args.orbit.map_or(ORBIT_STEP_DEGREES, |degrees| degrees / args.frames as f32)
}

pub(crate) fn run(args: &RenderArgs) -> Result<()> {
    let mut ranks = Ranks::join()?;
    if ranks.size() == 1 && args.checkpoint.is_none() {
        return alone(args);
    }
    let rendered = ranks::render::run(args, &mut ranks);
    ranks.leave(rendered)
}

/// Renders in this process.
fn alone(args: &RenderArgs) -> Result<()> {
    let start = Instant::now();
    let scheduling = args.balance.scheduling()?;
    let outputs = outputs(args, &FILES.map(|(name, _)| name));
    scene::check([scene_of(args)])?;
    outputs.check()?;
    let mut pictures = Pictures::new(&args.out, args.frames);
    if let Some(left) = pictures.leftovers() {
        note(format_args!("note: {left}"));
    }
    let RenderArgs { size, spp: samples, bounces, frames, .. } = *args;
    let needs = PictureNeeds { size, samples, bounces, frames, cut: args.balance.cut() };
    let waves = Room::now().waves(&needs, args.memory)?;
    let Stage { described, devices, balancer, first, renderer, mut animation, mut seconds } =
        Stage::set(args, &scheduling.limits, Some(&outputs))?;
    let mut renderer = Renderer { unused: true, ..renderer };
    let bar = progress::Whole::new(waves.pixels() * u64::from(args.spp * args.frames), (2 * args.bounces + 2).into());
    let show = |at: Progress| bar.show(at);
    let (mut runs, mut costs, costs_s) = (Vec::new(), CostMaps::new(args.size), Cell::new(0.0));
    let mut record = |traced: Traced<'_>| {
        let begin = Instant::now();
        costs.add(&traced.run, |ray| traced.pixel(ray));
        runs.push(traced.run);
        costs_s.set(costs_s.get() + begin.elapsed().as_secs_f64());
    };
    let mut session = Session { balancer, scheduling, show: &show, record: &mut record };
    let mut film = Film::new(args.size)?;
    // Whoever measures wants streams of all samples.
    let passes = if args.reference { Passes::whole(args.spp) } else { Passes::doubling(args.spp) };
    let (begin, end) = (Instant::now(), args.time.map(|time| start + time));
    let rendered = (0..args.frames).try_for_each(|number| {
        film.clear();
        animation.show(number, &mut renderer, &mut session)?;
        let paths = paths(args, &renderer, &first, number)?;
        let frame = Frame { paths: &paths, number, waves: &waves, end };
        frame.render(&renderer, &mut session, passes, &mut film, &mut |film, samples| {
            write(&mut pictures, film, number, samples)
        })
    });
    let waves_s = begin.elapsed().as_secs_f64() - costs_s.get() - pictures.seconds;
    let interrupted = match rendered {
        Err(error) if !interrupt::requested() || pictures.last().is_none() => return Err(error),
        rendered => rendered.is_err(),
    };
    let Session { scheduling, .. } = session;
    seconds.add_streams(&runs, animation.updates(), waves_s);
    let begin = Instant::now();
    drop(film);
    bar.stage("writing");
    let provenance = Provenance::now(args.balance.seed, names(&devices));
    if interrupted {
        // Before anything that may take longer than the patience with signals.
        note(format_args!("note: {}; report.json says more, charts and page are not made", pictures.told(args.spp)));
    } else {
        write_charts(args, costs.maps(), &runs, &provenance)?;
        pictures.write_sheet()?;
    }
    seconds.write += costs_s.get() + pictures.seconds + begin.elapsed().as_secs_f64();
    seconds.total = start.elapsed().as_secs_f64();
    let report = Report {
        schema: SCHEMA,
        provenance,
        picture: Some(picture_report(args, &pictures, CameraReport::of(&first, described.offset.into()))),
        scene: described,
        queue: scheduling.queue.name(),
        policy: scheduling.policy_name(),
        streams: runs.iter().map(|run| run.report.clone()).collect(),
        updates: animation.updates().to_vec(),
        cluster: Vec::new(),
        headline: Headline::of(&runs),
        seconds,
    };
    write_report(args, &report)?;
    interrupt::check()?;
    let (maps, picture) = (costs.maps(), &pictures.main());
    let rendered = html::render::Rendered { report: &report, runs: &runs, maps, picture, files: &FILES };
    rendered.write(&args.out.join("report.html"))?;
    drop(bar);
    if args.json {
        writeln!(Stdout, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        let explain = args.balance.explain;
        write!(Stdout, "{}", terminal::rendered(&report, &runs, explain, &args.out, terminal::columns()))?;
    }
    Ok(())
}

/// Writes a frame with so many samples of each pixel.
pub(crate) fn write(pictures: &mut Pictures, film: &Film, frame: u32, samples: u32) -> Result<()> {
    Ok(pictures.write((film.size(), film.sums()), || film.exposure(samples), frame, samples)?)
}

/// What was rendered.
pub(crate) fn picture_report(args: &RenderArgs, pictures: &Pictures, camera: CameraReport) -> PictureReport {
    let (frame, samples) = pictures.last().unwrap_or_default();
    PictureReport {
        size: args.size,
        samples,
        samples_asked: args.spp,
        bounces: args.bounces,
        frames: frame + 1,
        degrees_per_frame: if args.frames > 1 { degrees_per_frame(args) } else { 0.0 },
        wind: args.wind,
        seed: args.balance.seed,
        camera,
    }
}

/// A scene on this process's devices, ready to be rendered.
pub(crate) struct Stage {
    pub(crate) described: SceneReport,
    pub(crate) devices: Vec<Arc<dyn Device>>,
    pub(crate) balancer: Balancer,
    /// What the first frame shows.
    pub(crate) first: View,
    pub(crate) renderer: Renderer<'static>,
    pub(crate) animation: Animation,
    /// What it took.
    pub(crate) seconds: Seconds,
}

impl Stage {
    /// Reads the scene, builds its tree and brings it to the devices.
    pub(crate) fn set(args: &RenderArgs, limits: &Limits, outputs: Option<&Outputs>) -> Result<Self> {
        let prepared = args.source.prepare(scene_of(args))?;
        if let Some(outputs) = outputs {
            outputs.spare_materials(&prepared.libraries)?;
        }
        let first = choose_view(&prepared, args)?;
        let animation = Animation::new(wind(args, &prepared.model)?);
        let devices = args.balance.device.open(args.balance.devices.as_deref())?;
        let begin = Instant::now();
        let scene = Arc::clone(&prepared.built.scene);
        let mut balancer = Balancer::open(scene, &devices, limits, interrupt::control())?;
        *balancer.building() = prepared.options.build();
        let setup = begin.elapsed().as_secs_f64();
        let described = SceneReport::of(&prepared);
        let seconds = Seconds { load: prepared.load_s, build: prepared.build_s, setup, ..Seconds::default() };
        let renderer = Renderer {
            size: args.size,
            samples: args.spp,
            bounces: args.bounces,
            cut: args.balance.cut(),
            seed: args.balance.seed,
            reference: args.reference,
            ..Renderer::of(prepared, &first, interrupt::flag())
        };
        Ok(Self { described, devices, balancer, first, renderer, animation, seconds })
    }
}

/// The wind that was asked for.
fn wind(args: &RenderArgs, model: &Model) -> Result<Option<Wind>> {
    if args.wind && args.frames == 1 {
        return Err(usage("--wind moves the scene from frame to frame: give --frames 2 or more").into());
    }
    let wind = args.wind.then(|| {
        Wind::over(model).ok_or_else(|| {
            usage(format!("--wind: nothing in {} bends in the wind: render the scene yard", model.source))
        })
    });
    Ok(wind.transpose()?)
}

/// The paths of a frame of an orbit about the target that begins with the view `first`.
pub(crate) fn paths(args: &RenderArgs, renderer: &Renderer<'_>, first: &View, frame: u32) -> Result<Paths> {
    let seen = view::orbit(first, (degrees_per_frame(args) * frame as f32).to_radians());
    Ok(renderer.paths(seen.camera().context("the camera of the orbit")?, frame))
}

pub(crate) fn scene_of(args: &RenderArgs) -> &Path {
    args.scene.as_deref().unwrap_or(Path::new("yard"))
}

/// The pictures and `files` in the folder of results.
pub(crate) fn outputs(args: &RenderArgs, files: &[&str]) -> Outputs {
    let pictures = Pictures::new(&args.out, args.frames);
    let files = files.iter().copied().chain(pictures.sheet());
    let names: Vec<String> = pictures.names().chain(files.map(str::to_owned)).collect();
    Outputs::new().folder("--out", &args.out, names).scenes([scene_of(args)])
}

pub(crate) fn write_report(args: &RenderArgs, report: &Report) -> Result<()> {
    let path = args.out.join("report.json");
    Ok(output::write_atomically(&path, |file| Ok(serde_json::to_writer_pretty(file, report)?))?)
}

/// The view of the command line, else the scene's.
fn choose_view(prepared: &Prepared, args: &RenderArgs) -> Result<View> {
    let base = prepared.view_in(args.size[0] as f32 / args.size[1] as f32);
    let view = View {
        eye: args.eye.map_or(base.eye, |eye| prepared.model.place(eye)),
        target: args.target.map_or(base.target, |target| prepared.model.place(target)),
        up: args.up.unwrap_or(base.up),
        fov_degrees: args.fov.unwrap_or(base.fov_degrees),
    };
    view.camera().or_usage("--eye, --target, --up, --fov")?;
    Ok(view)
}

fn write_charts(args: &RenderArgs, costs: &[CostMap], runs: &[StreamRun], provenance: &Provenance) -> Result<()> {
    chart::timeline::write_svg(&args.out.join("timeline.svg"), runs, provenance)?;
    chart::trace::write_json(&args.out.join("trace.json"), runs, provenance)?;
    tasks::write_csv(&args.out.join("tasks.csv"), runs, provenance)?;
    Ok(cost::write_png(&args.out.join("cost.png"), costs)?)
}

/// What devices call themselves.
pub(crate) fn names(devices: &[Arc<dyn Device>]) -> impl Iterator<Item = &str> {
    devices.iter().map(|device| device.info().name.as_str())
}
