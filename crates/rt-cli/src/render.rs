//! `raybalance render`: a picture, and how well the work was balanced.

use crate::args::RenderArgs;
use crate::memory::{PictureNeeds, Room};
use crate::output::Outputs;
use crate::report::{Ahead, CameraReport, PictureReport, Report, SCHEMA, SceneReport, Seconds};
use crate::{html, interrupt, progress, ranks, scene};
use anyhow::Result;
use glam::DVec3;
use rt_balance::{Balancer, Limits};
use rt_cluster::Shard;
use rt_core::Device;
use rt_render::{Animation, AnimationPlan, Film, Frame, Passes, Progress, Renderer, Session, Subject, Traced};
use rt_report::chart::cost::CostMaps;
use rt_report::headline::Headline;
use rt_report::pictures::{Part, Pictures, Shot};
use rt_report::print::{Stdout, note};
use rt_report::usage::{OrUsage, usage};
use rt_report::{Provenance, charts, recipe, terminal};
use rt_scene::camera::{CameraMotion, CameraPath};
use rt_scene::wind::{Strength, Wind};
use rt_scene::{Model, View};
use std::cell::Cell;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// The orbit's angle between two frames unless another is asked for: a slow turn, so that the previous frame says much
/// about the next.
const ORBIT_STEP_DEGREES: f32 = 1.0;

pub(crate) fn run(args: &RenderArgs) -> Result<()> {
    if let (Some(recipe), Some(shards)) = (args.emit, args.shards) {
        check(args, None)?;
        let command = recipe::command_without(&["--emit", "--shards"])?;
        return Ok(write!(Stdout, "{}", recipe.script(&command, shards))?);
    }
    let mut ranks = ranks::join()?;
    if ranks.size() == 1 && args.checkpoint.is_none() {
        return alone(args);
    }
    let rendered = ranks::render::run(args, &mut ranks);
    ranks::leave(ranks, rendered)
}

/// Renders in this process.
fn alone(args: &RenderArgs) -> Result<()> {
    let start = Instant::now();
    let scheduling = args.balance.scheduling()?;
    let outputs = outputs(args, &charts::names(args.exr, args.shard));
    check(args, Some(&outputs))?;
    if let Some(left) = named(args).leftovers() {
        note(format_args!("note: {left}"));
    }
    let RenderArgs { size, spp: samples, bounces, .. } = *args;
    let frames = args.frames.count().div_ceil(args.shard.unwrap_or(Shard::WHOLE).of());
    let needs = PictureNeeds { size, samples, bounces, frames, cut: args.balance.cut() };
    let waves = Room::now().waves(&needs, args.memory)?;
    let (source, described) = Source::prepare(args, Some(&outputs))?;
    let Stage { devices, balancer, motion, renderer, mut animation, mut seconds, .. } =
        Stage::set(args, &scheduling.limits, source)?;
    let mut pictures = pictures(args, &renderer, &motion)?;
    let part = part(args, &pictures);
    let missing = &part.missing;
    if missing.is_empty() {
        return Ok(pictures.write_sheet()?);
    }
    let mut renderer = Renderer { unused: missing.first().copied(), ..renderer };
    let provenance = Provenance::of(args.balance.seed, &devices);
    let paths = waves.pixels() * u64::from(args.spp) * missing.len() as u64;
    let bar = progress::Whole::new(paths, (2 * args.bounces + 2).into());
    let show = |at: Progress| bar.show(at);
    let (mut runs, mut costs, costs_s) = (Vec::new(), CostMaps::new(args.size), Cell::new(0.0));
    let mut record = |traced: Traced<'_>| {
        let begin = Instant::now();
        costs.add(&traced.run, |rays, take| traced.pixels(rays, take));
        runs.push(traced.run);
        costs_s.set(costs_s.get() + begin.elapsed().as_secs_f64());
    };
    let mut session = Session { balancer, scheduling, show: &show, record: &mut record };
    let mut film = Film::new(args.size)?;
    // Whoever measures wants streams of all samples; of an animation nothing but whole frames is shown.
    let in_one_go = args.reference || args.frames.is_animation();
    let passes = if in_one_go { Passes::whole(args.spp) } else { Passes::doubling(args.spp) };
    let (begin, end) = (Instant::now(), args.time.map(|time| start + time));
    let rendered = missing.iter().try_for_each(|&number| {
        let begin = Instant::now();
        film.clear();
        animation.show(number, &mut renderer, &mut session)?;
        let paths = renderer.paths(motion.camera(number)?, number);
        let frame = Frame { paths: &paths, number, waves: &waves, end, show_every: rt_render::SHOW_EVERY };
        frame.render(&renderer, &mut session, passes, &mut film, &mut |film| write(&mut pictures, film, number))?;
        Ok(pictures.note(number, begin.elapsed().as_secs_f64(), &provenance)?)
    });
    let waves_s = begin.elapsed().as_secs_f64() - costs_s.get() - pictures.seconds;
    let interrupted = match rendered {
        Err(error) if !interrupt::requested() || pictures.last().is_none() => return Err(error),
        rendered => rendered.is_err(),
    };
    let Session { scheduling, .. } = session;
    seconds.add_streams(&runs, animation.updates(), waves_s);
    let begin = Instant::now();
    interrupt::saving(true);
    drop(film);
    bar.stage("writing");
    let maps = costs.into_maps();
    if args.shard.is_none() {
        charts::write(&args.out, args.exr, &maps, &runs, &provenance)?;
    }
    pictures.write_sheet()?;
    seconds.write += costs_s.get() + pictures.seconds + begin.elapsed().as_secs_f64();
    seconds.total = start.elapsed().as_secs_f64();
    let picture = picture_report(args, &pictures, &part, &motion, &described);
    let report = Report {
        schema: SCHEMA,
        provenance,
        picture: Some(PictureReport { interrupted, ..picture }),
        scene: described,
        queue: scheduling.queue.name(),
        policy: scheduling.policy_name(),
        streams: runs.iter().map(|run| run.report.clone()).collect(),
        updates: animation.updates().to_vec(),
        cluster: Vec::new(),
        headline: Headline::of(&runs),
        seconds,
    };
    report.write(&args.out, args.shard)?;
    if args.shard.is_none() {
        let (files, picture) = (charts::files(args.exr), &pictures.main());
        let rendered = html::render::Rendered { report: &report, runs: &runs, maps: &maps, picture, files: &files };
        rendered.write(&args.out.join("report.html"))?;
    }
    drop(bar);
    interrupt::saving(false);
    if let Some(missing) = report.missing().filter(|_| interrupted) {
        note(format_args!("note: {missing}; what is whole is in {}", args.out.display()));
    }
    if args.json {
        writeln!(Stdout, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        let explain = args.balance.explain;
        write!(Stdout, "{}", terminal::rendered(&report, &runs, explain, &args.out, terminal::columns()))?;
    }
    interrupt::check()
}

/// The pictures that are asked for.
fn named(args: &RenderArgs) -> Pictures {
    Pictures::new(&args.out, &args.frames).with_exr(args.exr)
}

/// Writes a frame as it is by now.
pub(crate) fn write(pictures: &mut Pictures, film: &Film, frame: u32) -> Result<()> {
    let shot = Shot {
        size: film.size(),
        sums: film.sums(),
        samples_at: &|place| film.samples_at(place),
        exposure: &|| film.exposure(),
        samples: film.samples(),
        ahead: film.ahead().map(|(samples, share)| Ahead { samples, share }),
    };
    Ok(pictures.write(shot, frame)?)
}

/// The pictures that are to be rendered with this motion of the camera.
pub(crate) fn pictures(args: &RenderArgs, renderer: &Renderer<'_>, motion: &CameraMotion) -> Result<Pictures> {
    let pictures = named(args);
    if !args.frames.is_animation() {
        return Ok(pictures);
    }
    let AnimationPlan { exposure, fingerprints } = renderer.plan(motion, args.frames.range())?;
    Ok(pictures.of_animation(exposure, fingerprints))
}

/// What this process is to render of them.
pub(crate) fn part(args: &RenderArgs, pictures: &Pictures) -> Part {
    let part = pictures.part(args.shard.unwrap_or(Shard::WHOLE), args.reference);
    if part.whole > 0 {
        let all = part.whole + part.missing.len() as u32;
        note(format_args!("note: {} of {all} frames are whole in {} already", part.whole, args.out.display()));
    }
    part
}

/// What was rendered of a part.
pub(crate) fn picture_report(
    args: &RenderArgs,
    pictures: &Pictures,
    part: &Part,
    motion: &CameraMotion,
    scene: &SceneReport,
) -> PictureReport {
    let first_frame = args.frames.range().start;
    PictureReport {
        size: args.size,
        samples: pictures.last().map_or(args.spp, |last| last.samples),
        samples_asked: args.spp,
        ahead: pictures.last().and_then(|last| last.ahead),
        interrupted: false,
        bounces: args.bounces,
        first_frame,
        frames: part.whole + pictures.written(),
        frames_asked: part.whole + part.missing.len() as u32,
        frames_before: part.whole,
        shard: args.shard.map(|shard| shard.to_string()),
        degrees_per_frame: match motion {
            CameraMotion::Orbit { degrees_per_frame, .. } if args.frames.is_animation() => *degrees_per_frame,
            _ => 0.0,
        },
        camera_path: args.camera.as_ref().map(|file| file.display().to_string()),
        wind: args.wind.map(Strength::times),
        seed: args.balance.seed,
        camera: CameraReport::of(&motion.view(first_frame), scene.offset.into()),
    }
}

/// A scene on this process's devices, ready to be rendered.
pub(crate) struct Stage {
    pub(crate) devices: Vec<Arc<dyn Device>>,
    pub(crate) balancer: Balancer,
    pub(crate) motion: CameraMotion,
    pub(crate) renderer: Renderer<'static>,
    pub(crate) animation: Animation,
    /// When the balancer was made, which its runs' times count from, on the clock of this process.
    pub(crate) begin_s: f64,
    /// What it took.
    pub(crate) seconds: Seconds,
}

/// A scene, and the view that shows it well.
pub(crate) struct Source {
    pub(crate) subject: Subject,
    pub(crate) view: View,
    /// Seconds until it was there, and until it had its tree.
    pub(crate) took_s: [f64; 2],
    pub(crate) wind: Option<Wind>,
}

impl Source {
    /// Reads the scene and builds its tree; also what is told of it.
    pub(crate) fn prepare(args: &RenderArgs, outputs: Option<&Outputs>) -> Result<(Self, SceneReport)> {
        let prepared = args.source.prepare(scene_of(args))?;
        if let Some(outputs) = outputs {
            outputs.spare_materials(&prepared.libraries)?;
        }
        let wind = wind(args, &prepared.model)?;
        let described = SceneReport::of(&prepared);
        let view = prepared.view_in(args.size[0] as f32 / args.size[1] as f32);
        let took_s = [prepared.load_s, prepared.build_s];
        Ok((Self { subject: Subject::of(prepared), view, took_s, wind }, described))
    }
}

impl Stage {
    /// Brings a scene to the devices.
    pub(crate) fn set(args: &RenderArgs, limits: &Limits, source: Source) -> Result<Self> {
        let Source { subject, view, took_s: [load, build], wind } = source;
        let motion = choose_motion(args, view, subject.offset)?;
        let devices = args.balance.device.open(args.balance.devices.as_deref())?;
        let (begin, begin_s) = (Instant::now(), rt_balance::clock().as_secs_f64());
        let scene = Arc::clone(&subject.scene);
        let mut balancer = Balancer::open(scene, &devices, limits, interrupt::control())?;
        *balancer.building() = args.source.options().build();
        let setup = begin.elapsed().as_secs_f64();
        let seconds = Seconds { load, build, setup, ..Seconds::default() };
        let renderer = Renderer {
            size: args.size,
            samples: args.spp,
            bounces: args.bounces,
            cut: args.balance.cut(),
            seed: args.balance.seed,
            reference: args.reference,
            wind: args.wind,
            ..Renderer::showing(subject, &motion.view(0), interrupt::flag())
        };
        let animation = Animation::new(wind);
        Ok(Self { devices, balancer, motion, renderer, animation, begin_s, seconds })
    }
}

/// The wind that was asked for.
fn wind(args: &RenderArgs, model: &Model) -> Result<Option<Wind>> {
    if args.wind.is_some() && !args.frames.is_animation() {
        return Err(usage("--wind moves the scene from frame to frame: give --frames 2 or more").into());
    }
    Ok(args.wind.map(|strength| Wind::over(model, strength).or_usage("--wind")).transpose()?)
}

/// Whether the scene is there, results can be written, and the camera path, which they must not replace, is one: before
/// any of it is worked on.
pub(crate) fn check(args: &RenderArgs, outputs: Option<&Outputs>) -> Result<()> {
    scene::check([scene_of(args)])?;
    if args.exr {
        rt_report::exr::check().or_usage("--exr")?;
    }
    outputs.map_or(Ok(()), Outputs::check)?;
    args.camera.as_deref().map_or(Ok(()), |file| Ok(CameraPath::read(file).map(drop)?))
}

pub(crate) fn scene_of(args: &RenderArgs) -> &Path {
    args.scene.as_deref().unwrap_or(Path::new("yard"))
}

/// The pictures and `files` in the folder of results.
pub(crate) fn outputs(args: &RenderArgs, files: &[String]) -> Outputs {
    let pictures = named(args);
    let names = pictures.files().chain(files.iter().map(PathBuf::from));
    let outputs = Outputs::new().folder("--out", &args.out, names).scenes([scene_of(args)]);
    args.camera.iter().fold(outputs, |outputs, path| outputs.input("the camera path", path))
}

/// The camera of the command line, else the scene's, and how it moves.
fn choose_motion(args: &RenderArgs, base: View, offset: DVec3) -> Result<CameraMotion> {
    let motion = match &args.camera {
        Some(file) => CameraMotion::Path { path: CameraPath::read(file)?, offset },
        None => {
            let first = View {
                eye: args.eye.map_or(base.eye, |eye| (eye - offset).as_vec3()),
                target: args.target.map_or(base.target, |target| (target - offset).as_vec3()),
                up: args.up.unwrap_or(base.up),
                fov_degrees: args.fov.unwrap_or(base.fov_degrees),
            };
            first.camera().or_usage("--eye, --target, --up, --fov")?;
            let degrees_per_frame = args.orbit.map_or(ORBIT_STEP_DEGREES, |all| all / args.frames.range().end as f32);
            CameraMotion::Orbit { first, degrees_per_frame }
        }
    };
    // Also the first one, by which light and exposure are chosen.
    motion.check(0..1)?;
    motion.check(args.frames.range())?;
    Ok(motion)
}
