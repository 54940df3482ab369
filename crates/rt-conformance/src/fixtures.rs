//! The scenes and rays of the suite, with what the exact reference says of them.

use glam::Vec3;
use rt_core::{Hit, Ray, Scene, Triangle};
use rt_verify::rays::RayMaker;
use rt_verify::reference::{Reference, Verdict};
use rt_verify::{brute, shapes, tree};
use std::sync::{Arc, OnceLock};

/// Rays for each scene: enough to meet every kind of aim some dozen times.
const RAYS: u32 = 240;

/// A scene, rays, and the right answers.
pub(crate) struct Fixture {
    pub(crate) name: &'static str,
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) scene: Arc<Scene>,
    /// Rays and the primitives they start on.
    pub(crate) rays: Vec<(Ray, u32)>,
    /// The exact reference's verdict for each ray.
    pub(crate) verdicts: Vec<Verdict>,
    /// Brute force's answer for each ray.
    pub(crate) hits: Vec<Hit>,
}

impl Fixture {
    pub(crate) fn new(name: &'static str, triangles: Vec<Triangle>, rays: Vec<(Ray, u32)>) -> Result<Self, String> {
        let scene = tree::build(&triangles, rt_bvh::Builder::Sah).map_err(|e| format!("{name}: {e}"))?;
        let verdicts = Reference::new(&triangles).resolve_all(&rays);
        let hits = rays.iter().map(|(ray, origin)| brute::closest(&triangles, ray, *origin)).collect();
        Ok(Self { name, triangles, scene, rays, verdicts, hits })
    }
}

/// All of them; made once.
pub(crate) fn all() -> Result<&'static [Fixture], String> {
    static ALL: OnceLock<Result<Vec<Fixture>, String>> = OnceLock::new();
    ALL.get_or_init(make).as_deref().map_err(Clone::clone)
}

/// A height field: most cases need no more.
pub(crate) fn plain() -> Result<&'static Fixture, String> {
    named("terrain")
}

pub(crate) fn named(name: &str) -> Result<&'static Fixture, String> {
    all()?.iter().find(|f| f.name == name).ok_or_else(|| format!("no fixture {name}"))
}

fn make() -> Result<Vec<Fixture>, String> {
    let scaled = |exponent: i32| -> Vec<Triangle> {
        shapes::soup(200, 0.4, 5).iter().map(|t| t.scaled(2.0_f32.powi(exponent))).collect()
    };
    let shapes = [
        ("terrain", shapes::grid(20, 0.2, 1)),
        ("soup", shapes::soup(600, 0.3, 2)),
        ("sphere", shapes::icosphere(3)),
        ("plane", shapes::grid(12, 0.0, 0)),
        ("needles", shapes::needles(300, 1e-5, 3)),
        ("layers", shapes::layers(5, 4)),
        ("mixed scales", shapes::mixed_scales(300, 4)),
        ("fan", shapes::fan(64)),
        ("far away", shapes::moved(&shapes::icosphere(2), Vec3::new(1e6, -1e6, 1e6))),
        ("tiny", scaled(-100)),
        ("huge", scaled(100)),
        ("one triangle", shapes::soup(1, 1.0, 6)),
        ("two triangles", shapes::grid(1, 0.1, 7)),
    ];
    let fixture = |(name, triangles): (&'static str, Vec<Triangle>)| {
        let rays = RayMaker::new(&triangles, 11).mixed(RAYS);
        Fixture::new(name, triangles, rays)
    };
    shapes.into_iter().map(fixture).collect()
}
