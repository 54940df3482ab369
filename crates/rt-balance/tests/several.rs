//! Scenes of several meshes, masks, and several hits of a ray, through a balancer.

use rt_balance::cpu::CpuDevice;
use rt_balance::estimators::{Sampled, Uniform};
use rt_balance::sample::Fraction;
use rt_balance::{
    Audit, BalanceError, Balancer, BuildOptions, Cause, Control, CostEstimator, Device, Hit, Mesh, Query, Ray,
    RaySource, Scene, Scheduling, Stream, StreamKind, StreamSpec, TestCounts, Updated, Walk, build_meshes,
};
use std::cell::Cell;
use std::num::NonZero;
use std::sync::Arc;

fn devices() -> Vec<Arc<dyn Device>> {
    let devices = CpuDevice::open_all(&[1, 2]).expect("two CPU devices");
    devices.into_iter().map(|device| Arc::new(device) as _).collect()
}

/// A square in the plane of a height, in two triangles.
fn square(z: f32) -> [[f32; 3]; 4] {
    [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]]
}

const HALVES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// Five squares above each other, each a mesh; the masks of the middle ones have the second bit.
fn tower() -> Arc<Scene> {
    let squares: Vec<[[f32; 3]; 4]> = (0..5u8).map(|floor| square(floor.into())).collect();
    let meshes: Vec<Mesh<'_>> = squares.iter().map(|square| Mesh::of_arrays(square, &HALVES)).collect();
    let scene = build_meshes(&meshes, &BuildOptions::default()).expect("squares can be built").scene;
    let masks = [1, 1, 3, 3, 3, 3, 3, 3, 1, 1].to_vec();
    Arc::new(Arc::unwrap_or_clone(scene).with_masks(masks).expect("one for each"))
}

/// From above, some beside the tower and some along the diagonal, where both halves of a square are hit.
fn stream(query: Query, mask: u32) -> Stream {
    let ray = |i: u16| {
        let (x, y) = (f32::from(i % 60) / 50.0, f32::from(i / 60) / 50.0);
        Ray::new([x, y, 9.0].into(), [0.0, 0.0, -1.0].into())
    };
    let source = RaySource::Explicit { rays: (0..3_000).map(ray).collect(), origins: None };
    let spec = StreamSpec { mask, ..StreamSpec::new(query, rt_balance::Precision::Robust, true) };
    Stream::new(source, StreamKind::Custom, spec).with_task_size(70)
}

fn all(most: u32) -> Query {
    Query::All { most: NonZero::new(most).expect("a place") }
}

/// What the host finds, ray by ray.
fn expected(scene: &Scene, stream: &Stream) -> (Vec<Hit>, Vec<TestCounts>) {
    let (mut hits, mut counts) = (Vec::new(), Vec::new());
    let rays = (0..stream.source.len()).map(|ray| stream.source.ray(ray));
    rt_bvh::trace_several(scene, &mut rt_bvh::Stack::for_scene(scene), stream.spec, rays, |found, count| {
        hits.extend_from_slice(found);
        counts.push(count);
    });
    (hits, counts)
}

/// Mutants: places of one ray where those of another belong; hits of walked rays kept, of which there is one; tasks
/// told with too few hits; counts in steps of hits.
#[test]
fn several_hits_arrive_whoever_traced_them() {
    let scene = tower();
    let mut balancer = Balancer::new(Arc::clone(&scene), &devices()).expect("a balancer");
    for (most, mask) in [(1, u32::MAX), (3, u32::MAX), (20, u32::MAX), (4, 2)] {
        let stream = stream(all(most), mask);
        let (right, counts) = expected(&scene, &stream);
        let exact = Sampled::new(Walk::Full, Fraction::new(0.25).expect("a share"));
        for estimator in [Box::new(Uniform) as Box<dyn CostEstimator>, Box::new(exact)] {
            let mut scheduling = Scheduling { estimator, audit: Audit::ALL, ..Scheduling::default() };
            let told = Cell::new(0);
            let finished = |now: rt_balance::Finished<'_>| {
                assert_eq!(now.hits.len(), now.task.rays as usize * most as usize);
                told.set(told.get() + now.hits.len());
            };
            let control = Control { finished: Some(&finished), ..Control::default() };
            let rubbish = Hit { t: -1.0, u: 0.0, v: 0.0, primitive: 7 };
            let (mut hits, mut counted) = (vec![rubbish; right.len()], vec![TestCounts::default(); counts.len()]);
            let run = balancer.trace(&stream, &mut scheduling, &mut hits, Some(&mut counted), control).expect("hits");
            assert!(hits == right && told.get() == right.len(), "{most} hits, mask {mask}");
            assert_eq!(counted, counts, "{most} hits, mask {mask}");
            assert_eq!(run.report.devices.iter().filter_map(|device| device.error.clone()).next(), None);
        }
    }
    let stream = stream(all(3), u32::MAX);
    let answer = balancer.trace(&stream, &mut Scheduling::default(), &mut [Hit::MISS; 3_000], None, Control::default());
    let error = answer.expect_err("three for each are needed");
    assert!(matches!(error, BalanceError::Hits { found: 3_000, rays: 3_000, most: 3 }), "{error}");
    assert!(error.to_string().ends_with("need 9000"), "{error}");
}

/// Mutants: masks lost on the way to a device, or when triangles move; a mask asked of the kernels that know none.
#[test]
fn masks_and_geometries_stay_when_triangles_move() {
    let scene = tower();
    let mut balancer = Balancer::new(Arc::clone(&scene), &devices()).expect("a balancer");
    let nearest = |balancer: &mut Balancer, mask: u32| {
        let mut hits = vec![Hit::MISS; 3_000];
        let stream = stream(Query::Closest, mask);
        balancer.trace(&stream, &mut Scheduling::default(), &mut hits, None, Control::default()).expect("hits");
        let hit = hits[60 * 20 + 10];
        (hit.t, balancer.scene().geometry_of(hit.primitive))
    };
    // Beside the diagonal: the second half of each square.
    assert_eq!(nearest(&mut balancer, u32::MAX), (5.0, Some((4, 1))));
    assert_eq!(nearest(&mut balancer, 2), (6.0, Some((3, 1))));
    assert_eq!(nearest(&mut balancer, 4), (f32::INFINITY, None));

    let floors = |heights: [f32; 5]| heights.map(square).concat();
    let faces: Vec<[u32; 3]> =
        (0..5).flat_map(|floor| HALVES.map(|half| half.map(|corner| corner + 4 * floor))).collect();
    let update = balancer.update(&floors([0.0, 1.0, 2.0, 3.5, 4.0]), &faces).expect("squares");
    assert_eq!(update.tree, Updated::Fitted);
    assert_eq!(nearest(&mut balancer, 2), (5.5, Some((3, 1))));
    // As many, of which two cannot be hit.
    let mut flat = faces.clone();
    flat[6..8].iter_mut().for_each(|face| *face = [face[0]; 3]);
    let update = balancer.update(&floors([0.0, 1.0, 2.0, 3.5, 4.0]), &flat).expect("squares");
    assert_eq!(update.tree, Updated::Rebuilt(Cause::OtherTriangles));
    assert_eq!(nearest(&mut balancer, 2), (7.0, Some((2, 1))));
    let error = balancer.update(&floors([0.0; 5]), &faces[2..]).expect_err("eight masks are not known");
    assert!(error.to_string().contains("replace_scene"), "{error}");
    assert_eq!(nearest(&mut balancer, 2), (7.0, Some((2, 1))));
}

/// Mutants: the tree of another mask, or of the scene before it moved; a tree that is gone since others were made; few
/// rays, which go alone, without their mask.
#[test]
fn streams_of_many_masks_take_turns() {
    const SIDE: u16 = 64;
    const MASKS: u32 = 6;
    let sheet = |time: f32| -> Vec<[f32; 3]> {
        let point = |i: u16| {
            let (x, y) = (f32::from(i % SIDE), f32::from(i / SIDE));
            [x, y, 3.0 * (0.4 * x + time).sin()]
        };
        (0..SIDE * SIDE).map(point).collect()
    };
    let corners = (0..SIDE * SIDE).filter(|i| i % SIDE < SIDE - 1 && i / SIDE < SIDE - 1);
    let faces = corners.flat_map(|i| [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]]);
    let faces: Vec<[u32; 3]> = faces.map(|face| face.map(u32::from)).collect();
    let (positions, options) = (sheet(0.0), BuildOptions::default());
    let scene = rt_balance::build(Mesh::of_arrays(&positions, &faces), &options).expect("a sheet").scene;
    let masks = (0..faces.len() as u32).map(|id| 1 << (id % MASKS)).collect();
    let scene = Arc::unwrap_or_clone(scene).with_masks(masks).expect("one for each");
    let mut balancer = Balancer::new(Arc::new(scene), &devices()).expect("a balancer");
    let ray = |i: u16| {
        let (x, y) = (f32::from(i % 61), f32::from(i / 61));
        Ray::new([x, y, 9.0].into(), [0.31, 0.17, -1.0].into())
    };
    let mut found = 0;
    for time in [0.0, 0.7] {
        assert_eq!(balancer.update(&sheet(time), &faces).expect("a sheet").tree, Updated::Fitted);
        for (turn, rays) in (0..2 * MASKS).flat_map(|turn| [300, 3_000].map(|rays| (turn, rays))) {
            let source = RaySource::Explicit { rays: (0..rays).map(ray).collect(), origins: None };
            let mask = 1 << (turn % MASKS) | 1 << ((turn + 2) % MASKS);
            let spec = StreamSpec { mask, ..StreamSpec::default() };
            let stream = Stream::new(source, StreamKind::Custom, spec);
            let mut hits = vec![Hit::MISS; rays.into()];
            let mut scheduling = Scheduling::default();
            balancer.trace(&stream, &mut scheduling, &mut hits, None, Control::default()).expect("hits");
            assert!(hits == expected(balancer.scene(), &stream).0, "{rays} rays, mask {mask:b}, {time}");
            found += hits.iter().filter(|hit| hit.is_hit()).count();
        }
    }
    assert!(found > 1_000, "{found} hits");
}
