//! The crate `obvhs` as a device, as it comes: its preset `medium_build` and its Möller–Trumbore test.

use crate::soup::Soup;
use crate::tracer::{Asked, Peer, PeerTracer, info};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use rt_core::{Clock, Device, DeviceError, DeviceInfo, Hit, Query, Ray, Scene, Tracer};
use std::sync::Arc;
use std::time::Duration;

/// Which of its trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ObvhsLayout {
    /// Two-wide, boxes in single precision.
    Bvh2,
    /// Eight-wide, boxes in 8 bits (H. Ylitie, T. Karras and S. Laine, 2017).
    CwBvh,
}

impl ObvhsLayout {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Bvh2, Self::CwBvh];

    /// The name that reports use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bvh2 => "Bvh2",
            Self::CwBvh => "CwBvh",
        }
    }
}

/// `obvhs` on some threads.
///
/// Meshes with very many equal centroids take it time quadratic in their number.
#[derive(Debug)]
pub struct ObvhsDevice {
    info: DeviceInfo,
    layout: ObvhsLayout,
}

impl ObvhsDevice {
    /// A device with this layout and so many threads; 0 is 1.
    #[must_use]
    pub fn new(layout: ObvhsLayout, threads: usize) -> Self {
        Self { info: info(format!("obvhs {}", layout.name()), "obvhs", threads), layout }
    }
}

impl Device for ObvhsDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let layout = self.layout;
        Ok(Box::new(PeerTracer::start(clock, self.info.units, move || Ok(Obvhs::new(&Soup::of(&scene), layout)))?))
    }
}

enum Tree {
    Bvh2(Bvh2),
    CwBvh(CwBvh),
}

struct Obvhs {
    /// `None` without triangles.
    tree: Option<Tree>,
    /// In leaf order.
    triangles: Vec<RtTriangle>,
    /// In leaf order.
    ids: Vec<u32>,
}

impl Obvhs {
    fn new(soup: &Soup, layout: ObvhsLayout) -> Self {
        if soup.triangles.is_empty() {
            return Self { tree: None, triangles: Vec::new(), ids: Vec::new() };
        }
        let given = |t: &rt_core::Triangle| {
            let [v0, v1, v2] = t.vertices().map(glam::Vec3A::from);
            obvhs::triangle::Triangle { v0, v1, v2 }
        };
        let triangles: Vec<_> = soup.triangles.iter().map(given).collect();
        let (parameters, mut unused) = (BvhBuildParams::medium_build(), Duration::ZERO);
        let (tree, order) = match layout {
            ObvhsLayout::Bvh2 => {
                let tree = build_bvh2_from_tris(&triangles, parameters, &mut unused);
                let order = tree.primitive_indices.clone();
                (Tree::Bvh2(tree), order)
            }
            ObvhsLayout::CwBvh => {
                let tree = build_cwbvh_from_tris(&triangles, parameters, &mut unused);
                let order = tree.primitive_indices.clone();
                (Tree::CwBvh(tree), order)
            }
        };
        let ids = order.iter().map(|&i| soup.id(i)).collect();
        let triangles = order.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect();
        Self { tree: Some(tree), triangles, ids }
    }

    fn test(&self, slot: usize, ray: &obvhs::ray::Ray, origin: u32) -> f32 {
        if self.ids[slot] == origin { f32::INFINITY } else { self.triangles[slot].intersect(ray) }
    }
}

impl Peer for Obvhs {
    fn trace(&self, rays: &[Ray], origins: &[u32], asked: Asked, hits: &mut [Hit]) {
        for ((hit, ray), &origin) in hits.iter_mut().zip(rays).zip(origins) {
            *hit = self.hit(ray, origin, asked.query);
        }
    }
}

impl Obvhs {
    fn hit(&self, ray: &Ray, origin: u32, query: Query) -> Hit {
        // It demands finite rays and checks them where debug assertions are on.
        let Some(tree) = self.tree.as_ref().filter(|_| ray.is_valid()) else { return Hit::MISS };
        let given = obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), ray.tmin, ray.tmax);
        let mut found = RayHit::none();
        let mut any = Hit::MISS;
        let nearest = |ray: &obvhs::ray::Ray, slot: usize| self.test(slot, ray, origin);
        let first = |ray: &obvhs::ray::Ray, slot: usize| {
            let t = self.test(slot, ray, origin);
            if t < ray.tmax {
                any = Hit { t, u: 0.0, v: 0.0, primitive: self.ids[slot] };
            }
            t
        };
        match (tree, query) {
            (Tree::Bvh2(tree), Query::Closest | Query::All { .. }) => _ = tree.ray_traverse(given, &mut found, nearest),
            (Tree::CwBvh(tree), Query::Closest | Query::All { .. }) => {
                _ = tree.ray_traverse(given, &mut found, nearest)
            }
            (Tree::Bvh2(tree), Query::Any) => _ = tree.ray_traverse_miss(given, first),
            (Tree::CwBvh(tree), Query::Any) => _ = tree.ray_traverse_miss(given, first),
        }
        let (Query::Closest | Query::All { .. }, Some(triangle)) =
            (query, self.triangles.get(found.primitive_id as usize))
        else {
            return any;
        };
        let weights = triangle.compute_barycentric(&given);
        let primitive = self.ids[found.primitive_id as usize];
        Hit { t: found.t, u: weights.x, v: weights.y, primitive }
    }
}
