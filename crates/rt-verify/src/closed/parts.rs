//! The closed parts of a mesh, and points inside them.

use super::{Closed, Inside};
use crate::reference::Reference;
use crate::{brute, exact, rays};
use glam::Vec3;
use rt_core::{Aabb, Ray, Triangle, random};
use std::collections::HashMap;

impl Closed {
    /// The closed parts of a mesh: pieces that hang together by equal vertices, whose every edge belongs to an even
    /// number of triangles, and in which a point inside is found. Largest first, at most `most`.
    #[must_use]
    pub fn parts(triangles: &[Triangle], most: usize, seed: u32) -> Vec<Self> {
        let mut pieces = pieces(triangles);
        pieces.retain(|piece| piece.len() >= 4 && is_closed(piece));
        pieces.sort_by_key(|piece| core::cmp::Reverse(piece.len()));
        // Some hundred tries find a point or there is none to be found: a sheet that was modelled twice, say.
        let part = |triangles: Vec<Triangle>| {
            let points = points_inside(&triangles, seed);
            (!points.is_empty()).then_some(Self { triangles, inside: Inside::Points(points) })
        };
        pieces.into_iter().take(4 * most).filter_map(part).take(most).collect()
    }
}

/// A vertex by its bits, both zeros being one.
fn key(point: Vec3) -> [u32; 3] {
    point.to_array().map(|x| (x + 0.0).to_bits())
}

/// Whether every edge belongs to an even number of triangles: then the surface has no border, and whether a point is
/// inside says the number of crossings of any way from it to infinity.
#[must_use]
pub fn is_closed(triangles: &[Triangle]) -> bool {
    let mut edges: HashMap<[[u32; 3]; 2], bool> = HashMap::new();
    for t in triangles {
        for (p, q) in [(t.a, t.b), (t.b, t.c), (t.c, t.a)] {
            let mut edge = [key(p), key(q)];
            edge.sort_unstable();
            let odd = edges.entry(edge).or_default();
            *odd = !*odd;
        }
    }
    edges.values().all(|odd| !odd)
}

/// Triangles that hang together by equal vertices; those that no ray can hit are left out.
fn pieces(triangles: &[Triangle]) -> Vec<Vec<Triangle>> {
    let mut vertices: HashMap<[u32; 3], u32> = HashMap::new();
    let mut parent: Vec<u32> = Vec::new();
    let usable: Vec<&Triangle> = triangles.iter().filter(|t| brute::has_area(t)).collect();
    let mut corners = Vec::with_capacity(usable.len());
    for t in &usable {
        let ids = t.vertices().map(|p| {
            *vertices.entry(key(p)).or_insert_with(|| {
                parent.push(parent.len() as u32);
                parent.len() as u32 - 1
            })
        });
        let roots = ids.map(|id| root(&mut parent, id));
        let lowest = roots.into_iter().min().unwrap_or(0);
        roots.into_iter().for_each(|r| parent[r as usize] = lowest);
        corners.push(ids[0]);
    }
    let mut pieces: HashMap<u32, Vec<Triangle>> = HashMap::new();
    for (t, corner) in usable.into_iter().zip(corners) {
        pieces.entry(root(&mut parent, corner)).or_default().push(*t);
    }
    let mut pieces: Vec<(u32, Vec<Triangle>)> = pieces.into_iter().collect();
    // Hash maps have no order, reports must.
    pieces.sort_by_key(|(id, _)| *id);
    pieces.into_iter().map(|(_, piece)| piece).collect()
}

/// The representative of a set, by path halving (R. Tarjan and J. van Leeuwen, *Worst-Case Analysis of Set Union
/// Algorithms*, 1984).
fn root(parent: &mut [u32], mut id: u32) -> u32 {
    while parent[id as usize] != id {
        parent[id as usize] = parent[parent[id as usize] as usize];
        id = parent[id as usize];
    }
    id
}

/// Lines tried in search of points inside, and points that are enough.
const LINES: u32 = 200;
const POINTS: usize = 16;

/// Points inside a closed surface, by the exact reference: the middles of what lines cross inside it.
fn points_inside(triangles: &[Triangle], seed: u32) -> Vec<Vec3> {
    let reference = Reference::new(triangles);
    let bounds = triangles.iter().map(Triangle::bounds).reduce(Aabb::union).unwrap_or(Aabb::EMPTY);
    let least = 1e-3 * bounds.extent().length();
    let mut points = Vec::new();
    for index in 0..LINES {
        let chosen = random::below(triangles.len() as u32, seed, index, 7);
        let [a, b, c] = triangles[chosen as usize].vertices();
        let unit = Vec3::from(random::pcg3d([seed, index, 8]).map(random::unit));
        let from = bounds.min + bounds.extent() * (unit * 3.0 - 1.0);
        let ray = Ray::new(from, a * 0.3 + b * 0.3 + c * 0.4 - from);
        let Some(crossings) = crossings(&reference, triangles, &ray) else { continue };
        for pair in crossings.windows(2).filter(|pair| (pair[1] - pair[0]) * ray.direction.length() > least) {
            let point = ray.at(f32::midpoint(pair[0], pair[1]));
            if is_inside(&reference, triangles, point, seed ^ index) {
                points.push(point);
            }
            if points.len() == POINTS {
                return points;
            }
        }
    }
    points
}

/// Whether a line from the point crosses the surface an odd number of times; no where that is doubtful.
fn is_inside(reference: &Reference<'_>, triangles: &[Triangle], point: Vec3, seed: u32) -> bool {
    let direction = rays::sphere(random::pair(seed, 0, 9));
    let ahead = |t: &&f32| **t > 0.0;
    crossings(reference, triangles, &Ray::new(point, direction))
        .is_some_and(|t| t.iter().filter(ahead).count() % 2 == 1)
}

/// Where a line crosses the surface, in order; `None` where that is doubtful.
fn crossings(reference: &Reference<'_>, triangles: &[Triangle], ray: &Ray) -> Option<Vec<f32>> {
    let ids = reference.survivors(&[(*ray, u32::MAX)]).pop()?;
    let mut found = Vec::new();
    for contact in ids.iter().filter_map(|&id| exact::contact(ray, &triangles[id as usize])) {
        let doubtful = !contact.certain || contact.t[0] * contact.t[1] <= 0.0;
        if doubtful {
            return None;
        }
        found.push(contact.t[0] as f32);
    }
    found.sort_by(f32::total_cmp);
    Some(found)
}
