//! Several meshes in one scene, masks, several hits of each ray, and a scene that moves.
//!
//! `cargo run --release -p rt-balance --example meshes`

use rt_balance::cpu::CpuDevice;
use rt_balance::{
    BalanceError, Balancer, BuildOptions, Control, Device, Hit, Mesh, Query, Ray, RaySource, Scheduling, Stream,
    StreamKind, StreamSpec, build_meshes,
};
use std::io::{Write, stdout};
use std::num::NonZero;
use std::sync::Arc;

/// What is solid, and what light goes through.
const SOLID: u32 = 0b01;
const CLEAR: u32 = 0b10;

/// A square at a height, in two triangles.
fn square(height: f32) -> Vec<[f32; 3]> {
    vec![[-1.0, height, -1.0], [1.0, height, -1.0], [1.0, height, 1.0], [-1.0, height, 1.0]]
}

const HALVES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// Rays straight down, of which some pass beside the squares, and how they are to be traced.
fn trace(balancer: &mut Balancer, spec: StreamSpec) -> Result<Vec<Hit>, BalanceError> {
    let ray =
        |i: u32| Ray::new([(i % 100) as f32 * 0.03 - 1.5, 5.0, (i / 100) as f32 * 0.03 - 1.5].into(), DOWN.into());
    let source = RaySource::Explicit { rays: (0..10_000).map(ray).collect(), origins: None };
    let stream = Stream::new(source, StreamKind::Custom, spec);
    let mut hits = vec![Hit::MISS; stream.source.len() as usize * spec.query.hits_per_ray()];
    balancer.trace(&stream, &mut Scheduling::default(), &mut hits, None, Control::default())?;
    Ok(hits)
}

const DOWN: [f32; 3] = [0.0, -1.0, 0.0];

/// The ray through the middle of the squares, but for their diagonal.
const MIDDLE: usize = 50 * 100 + 45;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (floor, glass) = (square(0.0), square(1.0));
    let meshes = [Mesh::of_arrays(&floor, &HALVES), Mesh::of_arrays(&glass, &HALVES)];
    let scene = build_meshes(&meshes, &BuildOptions::default())?.scene;
    // A mask for each triangle, those of the first mesh first.
    let scene = Arc::unwrap_or_clone(scene).with_masks(vec![SOLID, SOLID, CLEAR, CLEAR])?;
    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&[1, 1])?.into_iter().map(|device| Arc::new(device) as _).collect();
    let mut balancer = Balancer::new(Arc::new(scene), &devices)?;

    // The nearest hit, and which triangle of which mesh it is of.
    let nearest = trace(&mut balancer, StreamSpec::default())?[MIDDLE];
    let met = balancer.scene().geometry_of(nearest.primitive);
    writeln!(stdout(), "a ray meets triangle and mesh {met:?} at {}", nearest.t)?;
    assert_eq!((nearest.t, met), (4.0, Some((1, nearest.primitive - 2))));

    // Rays pass by what is clear.
    let solid = trace(&mut balancer, StreamSpec { mask: SOLID, ..StreamSpec::default() })?[MIDDLE];
    assert_eq!((solid.t, solid.primitive < 2), (5.0, true));

    // Up to four hits of each ray, in order; the places of ray `i` begin at `4 * i`.
    let most = NonZero::new(4).ok_or("above 0")?;
    let all = trace(&mut balancer, StreamSpec { query: Query::All { most }, ..StreamSpec::default() })?;
    let of_ray: Vec<f32> = all[4 * MIDDLE..][..4].iter().filter(|hit| hit.is_hit()).map(|hit| hit.t).collect();
    writeln!(stdout(), "all hits of it: {of_ray:?}")?;
    assert_eq!(of_ray, [4.0, 5.0]);

    // The next frame: the glass has sunk. Masks and meshes stay, and what was learnt does.
    let positions = [floor, square(0.25)].concat();
    let indices = [HALVES, HALVES.map(|half| half.map(|corner| corner + 4))].concat();
    let update = balancer.update(&positions, &indices)?;
    let nearest = trace(&mut balancer, StreamSpec::default())?[MIDDLE];
    writeln!(stdout(), "{:?} in {:.2} ms: now at {}", update.tree, 1e3 * (update.fit_s + update.build_s), nearest.t)?;
    assert_eq!(nearest.t, 4.75);
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
