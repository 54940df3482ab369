//! Animations in which the scene moves.

use glam::Vec3;
use rt_balance::cpu::CpuDevice;
use rt_balance::estimators::History;
use rt_balance::report::{StreamReport, UpdateReport};
use rt_balance::{Balancer, BuildOptions, Control, Device, Hit, MOST_GROWTH, Mesh, Scheduling, Stream, build};
use rt_bvh::Builder;
use rt_core::bounce::Surfaces;
use rt_core::{StreamKind, StreamSpec};
use rt_render::{Animation, Film, Frame, Passes, RenderError, Renderer, Session, TaskCut};
use rt_scene::View;
use rt_scene::prepare::{Options, prepare};
use rt_scene::streams::{Samples, Waves};
use rt_scene::wind::{FRAMES_PER_SECOND, Strength, Wind};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

const SIZE: [u32; 2] = [96, 60];
const SAMPLES: u32 = 2;
const FRAMES: u32 = 4;

static NEVER: AtomicBool = AtomicBool::new(false);

/// The built-in garden, and wind over it.
fn garden(strength: Strength) -> (Renderer<'static>, View, Wind) {
    let options = Options::new(Builder::default());
    let prepared = prepare(Path::new("yard"), &options, &mut |_| ControlFlow::Continue(())).expect("a built-in scene");
    let (view, wind) = (prepared.view(), Wind::over(&prepared.model, strength).expect("trees"));
    let renderer = Renderer {
        size: SIZE,
        samples: SAMPLES,
        bounces: 1,
        cut: TaskCut::Size(256),
        seed: 5,
        ..Renderer::of(prepared, &view, &NEVER)
    };
    (renderer, view, wind)
}

fn devices() -> Vec<Arc<dyn Device>> {
    let devices = CpuDevice::open_all(&[1, 1]).expect("two CPU devices");
    devices.into_iter().map(|device| Arc::new(device) as _).collect()
}

fn render(renderer: &Renderer<'_>, view: &View, session: &mut Session<'_>, number: u32) -> Vec<Vec3> {
    let paths = renderer.paths(view.camera().expect("a camera"), number);
    let waves = Waves::new(SIZE, SAMPLES, 1, u64::MAX).expect("a size");
    let mut film = Film::new(SIZE).expect("memory");
    let frame = Frame { paths: &paths, number, waves: &waves, end: None, show_every: Duration::MAX };
    let shown: &mut dyn FnMut(&Film) -> Result<(), RenderError> = &mut |_| Ok(());
    frame.render(renderer, session, Passes::whole(SAMPLES), &mut film, shown).expect("a picture");
    film.sums().to_vec()
}

/// Hits of a frame's camera rays.
fn hits(renderer: &Renderer<'_>, view: &View, balancer: &mut Balancer) -> Vec<Hit> {
    let paths = renderer.paths(view.camera().expect("a camera"), 0);
    let wave = Waves::new(SIZE, SAMPLES, 1, u64::MAX).expect("a size").wave(0);
    let source = paths.part(&wave, Samples::all(SAMPLES)).source;
    let mut hits = vec![Hit::MISS; source.len() as usize];
    let stream = Stream::new(source, StreamKind::Primary, StreamSpec::default());
    balancer.trace(&stream, &mut Scheduling::default(), &mut hits, None, Control::default()).expect("hits");
    hits
}

/// Shows frames of the garden in the wind, estimated by what the ones before took; `each` is told the number and the
/// picture. What was recorded of their streams, and of the updates before them.
fn played(
    strength: Strength,
    frames: impl IntoIterator<Item = u32>,
    mut each: impl FnMut(u32, &[Vec3], &Renderer<'_>, &View, &mut Session<'_>),
) -> (Vec<StreamReport>, Vec<UpdateReport>) {
    let (mut renderer, view, wind) = garden(strength);
    let balancer = Balancer::new(Arc::clone(renderer.surfaces.scene()), &devices()).expect("processors take it");
    let mut reports: Vec<StreamReport> = Vec::new();
    let mut record = |traced: rt_render::Traced<'_>| reports.push(traced.run.report);
    let scheduling = Scheduling { estimator: Box::new(History::default()), ..Scheduling::default() };
    let mut session = Session { balancer, scheduling, show: &|_| {}, record: &mut record };
    let mut animation = Animation::new(Some(wind));
    for number in frames {
        assert_eq!(animation.show(number, &mut renderer, &mut session).expect("an update"), number > 0);
        let picture = render(&renderer, &view, &mut session, number);
        each(number, &picture, &renderer, &view, &mut session);
    }
    drop(session);
    (reports, animation.updates().to_vec())
}

/// Mutants: a picture of the scene before; surfaces of another scene than the one that is traced; an estimator that
/// begins anew with each frame; a frame that is not reported.
#[test]
fn frames_in_the_wind_are_those_of_scenes_built_for_them_and_history_goes_on() {
    let (_, _, mut moved) = garden(Strength::BREEZE);
    let mut before = Vec::new();
    let (reports, updates) = played(Strength::BREEZE, 0..FRAMES, |number, picture, renderer, view, session| {
        let found = hits(renderer, view, &mut session.balancer);
        assert!(found != before, "frame {number} shows what the one before does");

        let Mesh { positions, indices } = moved.after(number as f32 / FRAMES_PER_SECOND);
        let anew = build(Mesh { positions, indices }, &BuildOptions::default()).expect("the garden").scene;
        let mut balancer = Balancer::new(Arc::clone(&anew), &devices()).expect("processors take it");
        assert!(hits(renderer, view, &mut balancer) == found, "frame {number}");
        let (other, _, _) = garden(Strength::BREEZE);
        let other = Renderer { surfaces: Arc::new(Surfaces::new(anew)), ..other };
        let mut alone = Session { balancer, scheduling: Scheduling::default(), show: &|_| {}, record: &mut |_| {} };
        assert!(render(&other, view, &mut alone, number) == picture, "frame {number}");
        before = found;
    });
    assert_eq!(updates.iter().map(|update| update.frame).collect::<Vec<_>>(), [1, 2, 3]);
    assert!(updates.iter().all(|update| update.tree == "fitted" && update.fit_s > 0.0), "{updates:?}");
    // Samples were walked for the first frame alone.
    let sampled = |report: &StreamReport| report.estimate.fraction > 0.0;
    assert!(reports.iter().all(|report| sampled(report) == (report.frame == 0)));
    assert!(reports.iter().any(|report| report.frame == FRAMES - 1 && report.rays > 1000));
}

/// Mutants: a tree that is fitted whatever it costs then; an estimator that begins anew with another tree.
#[test]
fn a_hurricane_has_the_tree_built_anew_and_history_goes_on() {
    let (reports, updates) = played("40".parse().expect("a strength"), [0, 3, 4], |_, _, _, _, _| {});
    let [first, second] = &updates[..] else { panic!("two updates: {updates:?}") };
    assert_eq!([first, second].map(|update| (update.frame, update.tree)), [(3, "rebuilt"), (4, "fitted")]);
    assert!(first.growth > Some(MOST_GROWTH) && first.build_s > 0.0 && first.why.is_some(), "{first:?}");
    assert!(reports.iter().all(|report| (report.estimate.fraction > 0.0) == (report.frame == 0)));
}
