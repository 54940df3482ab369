//! Pictures that several ranks render together are those that one process renders.

use glam::Vec3;
use rt_balance::cpu::CpuDevice;
use rt_balance::{Balancer, Device, Scheduling};
use rt_bvh::Builder;
use rt_cluster::local::{LocalRank, Weather, network};
use rt_cluster::{ClusterError, Deal, Dealt, Finished, Patience, deal};
use rt_render::tiles::{FrameTiles, cut, fingerprint, fingerprint_of_scene, unpack};
use rt_render::{Film, Frame, Passes, RenderError, Renderer, Session, TaskCut};
use rt_scene::prepare::{Options, prepare};
use rt_scene::streams::{Paths, Waves};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::{Duration, Instant};

const SIZE: [u32; 2] = [150, 97];

const SAMPLES: u32 = 5;

static NEVER: AtomicBool = AtomicBool::new(false);

/// The built-in garden, seen as always.
fn garden() -> (Renderer<'static>, Paths) {
    let options = Options::new(Builder::default());
    let prepared = prepare(Path::new("yard"), &options, &mut |_| ControlFlow::Continue(())).expect("a built-in scene");
    let view = prepared.view();
    let renderer = Renderer {
        size: SIZE,
        samples: SAMPLES,
        bounces: 1,
        cut: TaskCut::Size(1024),
        seed: 5,
        ..Renderer::of(prepared, &view, &NEVER)
    };
    let paths = renderer.paths(view.camera().expect("a camera"), 0);
    (renderer, paths)
}

fn with_session<T>(renderer: &Renderer<'_>, work: impl FnOnce(&mut Session<'_>) -> T) -> T {
    let devices = CpuDevice::open_all(&[1]).expect("a processor").into_iter();
    let devices: Vec<Arc<dyn Device>> = devices.map(|device| Arc::new(device) as _).collect();
    let balancer = Balancer::new(Arc::clone(renderer.surfaces.scene()), &devices).expect("a processor takes it");
    let mut session = Session { balancer, scheduling: Scheduling::default(), show: &|_| {}, record: &mut |_| {} };
    work(&mut session)
}

fn waves() -> Waves {
    Waves::new(SIZE, SAMPLES, 1, u64::MAX).expect("a size")
}

/// Of one process, in so many waves and in passes.
fn rendered(renderer: &Renderer<'_>, paths: &Paths, waves: &Waves, passes: Passes) -> Film {
    let mut film = Film::new(SIZE).expect("memory");
    let frame = Frame { paths, number: 0, waves, end: None, show_every: Duration::from_millis(5) };
    let mut samples = 0;
    let shown: &mut dyn FnMut(&Film) -> Result<(), RenderError> = &mut |film| {
        assert!(film.samples() >= samples.max(1), "shown before every pixel has a sample, or with fewer than before");
        assert!(film.ahead().is_none_or(|(ahead, share)| ahead > film.samples() && share < 1.0));
        samples = film.samples();
        Ok(())
    };
    with_session(renderer, |session| frame.render(renderer, session, passes, &mut film, shown)).expect("a picture");
    film
}

/// Of one process, at one go.
fn alone(renderer: &Renderer<'_>, paths: &Paths) -> Film {
    rendered(renderer, paths, &waves(), Passes::whole(SAMPLES))
}

/// Fails when sums depend on the passes, a pass numbers its samples from 0, or one of a single sample goes through the
/// centres of pixels.
#[test]
fn passes_make_the_picture_of_one_go() {
    let (renderer, paths) = garden();
    let whole = alone(&renderer, &paths);
    let small = Waves::new(SIZE, SAMPLES, 256, 1 << 20).expect("a size");
    assert!(small.count() > 1);
    for waves in [waves(), small] {
        assert!(rendered(&renderer, &paths, &waves, Passes::doubling(SAMPLES)).sums() == whole.sums());
    }
    // What is shown after the first pass is the picture of one sample of as many.
    let mut first = Vec::new();
    let mut film = Film::new(SIZE).expect("memory");
    let frame =
        Frame { paths: &paths, number: 0, waves: &waves(), end: Some(Instant::now()), show_every: Duration::MAX };
    let shown: &mut dyn FnMut(&Film) -> Result<(), RenderError> = &mut |film| {
        first.push((film.samples(), film.sums().to_vec()));
        Ok(())
    };
    with_session(&renderer, |session| frame.render(&renderer, session, Passes::doubling(SAMPLES), &mut film, shown))
        .expect("a picture");
    // Its time was over before it began: one pass is made all the same.
    assert_eq!(first.iter().map(|(samples, _)| *samples).collect::<Vec<_>>(), [1]);
    assert!(first[0].1 != whole.sums());
}

type Ended = Result<Dealt, ClusterError>;

/// Of several ranks, the film of rank 0.
fn together(renderer: &Renderer<'_>, paths: &Paths, ranks: Vec<LocalRank>) -> (Film, Vec<Ended>) {
    let tiles = cut(waves(), SAMPLES, ranks.len() as u32);
    assert!(tiles.count() > 5, "{tiles:?}");
    let patience =
        Patience { heartbeat: Duration::from_millis(50), rank: Duration::from_millis(500), ..Patience::default() };
    let about = Deal {
        patience,
        ..Deal::new(tiles.count() as u32, fingerprint(fingerprint_of_scene(renderer), renderer, paths, &tiles))
    };
    let mut film = Film::new(SIZE).expect("memory");
    let run = |mut rank: LocalRank, film: &mut Film| {
        with_session(renderer, |session| {
            let mut job = FrameTiles { renderer, session, paths, frame: 0, tiles };
            let mut take = |Finished { tile, bytes, .. }: Finished<'_>| {
                let pixels = tiles.wave(tile.into()).pixels;
                film.take(&pixels, &unpack(tile, pixels.len(), bytes).expect("its pixels"), SAMPLES);
                Ok(())
            };
            deal(&mut rank, &about, &mut job, &mut take)
        })
    };
    let mut ranks = ranks.into_iter();
    let own = ranks.next().expect("rank 0");
    let ended = thread::scope(|threads| {
        let run = &run;
        let start = |rank| threads.spawn(move || run(rank, &mut Film::new([1, 1]).expect("memory")));
        let others: Vec<_> = ranks.map(start).collect();
        let own = run(own, &mut film);
        let others = others.into_iter().map(|rank| rank.join().expect("no panic"));
        std::iter::once(own).chain(others).collect()
    });
    (film, ended)
}

fn bits(film: &Film) -> Vec<[u32; 3]> {
    film.sums().iter().map(|sum| sum.to_array().map(f32::to_bits)).collect()
}

/// Fails when random numbers go by the place in a tile, when pixels of tiles are swapped, or when tiles leave some out.
#[test]
fn the_picture_is_the_same_for_any_number_of_ranks() {
    let (renderer, paths) = garden();
    let whole = alone(&renderer, &paths);
    assert!(whole.sums().iter().all(|&sum| sum != Vec3::ZERO), "there is light everywhere in the garden");
    for ranks in 1..=4 {
        let weather = Weather { seed: ranks, delay: Duration::from_millis(3) };
        let (film, ended) = together(&renderer, &paths, network(ranks, weather));
        assert!(bits(&film) == bits(&whole), "another picture with {ranks} ranks");
        assert!(ended.iter().all(Result::is_ok), "{ended:?}");
    }
}

/// Fails when the tiles of a lost rank are forgotten, or counted twice.
#[test]
fn the_picture_is_the_same_when_ranks_are_lost() {
    let (renderer, paths) = garden();
    let whole = alone(&renderer, &paths);
    let ranks = network(3, Weather::CALM).into_iter();
    let ranks = ranks.enumerate().map(|(number, rank)| match number {
        0 => rank,
        // In the middle of its work, and before it has done anything.
        1 => rank.dying_after(6),
        _ => rank.dying_after(2),
    });
    let (film, ended) = together(&renderer, &paths, ranks.collect());
    assert!(bits(&film) == bits(&whole), "another picture");
    let report = ended[0].as_ref().expect("all tiles").report.as_ref().expect("a report of rank 0");
    assert_eq!(report.ranks.iter().map(|rank| rank.tiles).sum::<u32>(), report.tiles);
}

/// Fails when ranks that would render another picture are not told apart.
#[test]
fn other_pictures_have_other_fingerprints() {
    let (renderer, paths) = garden();
    let tiles = cut(waves(), SAMPLES, 2);
    let of = |renderer: &Renderer<'_>, paths: &Paths, tiles: &Waves| {
        fingerprint(fingerprint_of_scene(renderer), renderer, paths, tiles)
    };
    let first = of(&renderer, &paths, &tiles);
    assert_eq!(first, of(&renderer, &paths, &tiles));
    assert_ne!(first, of(&renderer, &Paths { seed: 6, ..paths.clone() }, &tiles));
    assert_ne!(first, of(&renderer, &paths, &tiles.split(tiles.count() + 1)));
    let (mut other, paths) = garden();
    other.bounces = 2;
    assert_ne!(first, of(&other, &paths, &tiles));
}
