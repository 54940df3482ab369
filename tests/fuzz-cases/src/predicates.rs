//! The definition of a hit against whole numbers: single pairs of ray and triangle, and small scenes of any magnitudes.

use crate::bytes::Bytes;
use glam::Vec3;
use rt_bvh::{BuildOptions, Builder, InvalidTriangles, Mesh, PlocQuality, Stack, build};
use rt_core::intersect::{self, Shear};
use rt_core::{Hit, Precision, Query, Ray, SCALE_EXPONENTS, StreamSpec, Triangle};
use rt_verify::exact;
use rt_verify::reference::Reference;

/// Most triangles and rays of an input: whole numbers are slow.
const MOST: usize = 24;

/// Builds a scene and traces rays: every pair has the hit, and every ray the nearest hit, that whole numbers say, to
/// the last bit of the distance, in the coordinates of the file and in those of the tree.
pub fn predicates(data: &[u8]) {
    let mut bytes = Bytes(data);
    let mut triangles = Vec::new();
    for _ in 0..usize::from(bytes.byte()) % MOST {
        triangles.push(Triangle::new(point(&mut bytes), point(&mut bytes), point(&mut bytes)));
    }
    let mut rays = Vec::new();
    while !bytes.is_empty() && rays.len() < MOST {
        let origin = point(&mut bytes);
        let direction = match bytes.byte() {
            way @ 0..=127 if !triangles.is_empty() => {
                let [a, b, c] = triangles[usize::from(way) % triangles.len()].vertices();
                let [v, w] = [bytes.byte(), bytes.byte()].map(|weight| f32::from(weight % 9) / 8.0);
                a + (b - a) * v + (c - a) * w - origin
            }
            _ => point(&mut bytes),
        };
        let ray = Ray::new(origin, direction);
        let ray = if bytes.byte() & 1 == 0 { ray } else { ray.with_range(bytes.coordinate(), bytes.coordinate()) };
        rays.push((ray, u32::MAX));
    }
    for (ray, _) in rays.iter().filter(|(ray, _)| ray.is_valid()) {
        for triangle in triangles.iter().filter(|triangle| triangle.is_finite()) {
            pair(ray, triangle);
        }
    }
    scene(&triangles, &rays);
}

/// A point of any magnitude, or of whole numbers at any magnitude.
fn point(bytes: &mut Bytes<'_>) -> Vec3 {
    match bytes.byte() {
        0..=127 => bytes.point(),
        128..=191 => {
            let exponent = i32::from(bytes.byte() as i8);
            bytes.point() * 2.0_f32.powi(exponent.clamp(-126, 126))
        }
        _ => bytes.vector(),
    }
}

/// One ray and one triangle.
fn pair(ray: &Ray, triangle: &Triangle) {
    let limits = [f32::NEG_INFINITY, f32::INFINITY];
    let right = exact::hit(ray, triangle).filter(|t| t.is_finite());
    let found = intersect::hit(&ray.with_range(limits[0], limits[1]), triangle, 0);
    assert_eq!(found.map(|hit| hit.t.to_bits()), right.map(f32::to_bits), "{ray:?}, {triangle:?}");
    if right.is_some() {
        assert!(intersect::has_area(triangle), "{triangle:?} is hit, but has no area");
    }
    for exponent in [*SCALE_EXPONENTS.start(), -20, 64, *SCALE_EXPONENTS.end()] {
        let scale = 2.0_f64.powi(-exponent);
        let local = triangle.vertices().map(|p| (p.as_dvec3() * scale).as_vec3());
        let lossless = local.iter().zip(triangle.vertices()).all(|(q, p)| q.as_dvec3() == p.as_dvec3() * scale);
        if lossless {
            let local = Triangle::new(local[0], local[1], local[2]);
            let again = Shear::new(ray, exponent, f64::INFINITY).hit(&local, limits, 0);
            assert_eq!(bits(again), bits(found), "{ray:?}, {triangle:?}, in units of 2^{exponent}");
        }
    }
}

fn bits(hit: Option<Hit>) -> Option<[u32; 4]> {
    hit.map(|hit| [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive])
}

/// Trees of both builders, both careful precisions, nearest and any hits.
fn scene(triangles: &[Triangle], rays: &[(Ray, u32)]) {
    let verdicts = Reference::new(triangles).resolve_all(rays);
    let positions: Vec<Vec3> = triangles.iter().flat_map(Triangle::vertices).collect();
    let indices: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    for builder in [Builder::Sah, Builder::Ploc(PlocQuality::Medium)] {
        let options = BuildOptions { builder, invalid: InvalidTriangles::Drop, max_leaf: 2 };
        let mesh = Mesh { positions: &positions, indices: &indices };
        let scene = build(mesh, &options).expect("indices are in range").scene;
        for precision in [Precision::Robust, Precision::Double] {
            for query in [Query::Closest, Query::Any] {
                let spec = StreamSpec::new(query, precision, false);
                let mut hits = Vec::new();
                let mut stack = Stack::for_scene(&scene);
                rt_bvh::trace(&scene, &mut stack, spec, rays.iter().copied(), |hit, _| hits.push(hit));
                for ((hit, verdict), (ray, _)) in hits.iter().zip(&verdicts).zip(rays) {
                    let right = match query {
                        Query::Closest | Query::All { .. } => verdict.is_right(hit),
                        Query::Any => verdict.right().is_some() == hit.is_hit(),
                    };
                    assert!(right, "{builder}, {precision:?}, {query:?}: {ray:?}: {hit:?}, but {verdict}");
                }
            }
        }
    }
}
