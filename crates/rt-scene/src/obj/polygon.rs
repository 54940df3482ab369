//! Polygons become triangles that cover them, notches left open.
//!
//! A polygon of `n` corners becomes `n − 2` triangles. Where the fan from its first corner covers it, as in every
//! convex polygon, the triangles are that fan: corners 1 2 3, 1 3 4, 1 4 5 and so on. Else its constrained Delaunay
//! triangulation in its plane is taken, which uses every corner, also those on straight edges, so that no crack opens
//! beside the neighbours.

use glam::{DVec2, DVec3};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

/// What was found about a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    /// Its triangles cover it.
    Plain,
    /// Likewise, but its corners do not lie in a plane, so that other triangles would be as right.
    Warped,
    /// It crosses itself: its triangles are the fan, which is as wrong as anything.
    Crossing,
    /// A corner is not finite, or far beyond single precision.
    NotFinite,
}

/// Distance of a corner from the polygon's plane over its distance from the first corner, without a unit, above which a
/// polygon counts as warped. Exporters round coordinates, and smooth surfaces are made of quadrilaterals that are
/// nearly plane.
const WARPED: f64 = 0.01;

/// Share of a polygon's area up to which a triangle that is turned the wrong way is taken for rounding.
const SLACK: f64 = 1e-12;

/// Area over the square of the diameter, without a unit, below which a polygon has none to speak of.
const NO_AREA: f64 = 1e-12;

/// Squares and products of two coordinates up to here stay finite and far from the end of double precision.
const LARGEST: f64 = 4.0 * f32::MAX as f64;

/// The fan from the first corner.
pub(crate) fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]])
}

/// The corners of a polygon of which this is the fan.
pub(super) fn corners_of(fan: &[[u32; 3]]) -> impl Iterator<Item = u32> {
    fan.first().into_iter().flat_map(|first| [first[0], first[1]]).chain(fan.iter().map(|triangle| triangle[2]))
}

/// Makes `triangles`, the fan of a polygon with these corners, cover it.
pub(crate) fn cover(corners: &[u32], triangles: &mut [[u32; 3]], vertices: &[DVec3]) -> Shape {
    let count = corners.len();
    let place = |k: usize| vertices[corners[k] as usize];
    if !(0..count).all(|k| place(k).abs().cmple(DVec3::splat(LARGEST)).all()) {
        return Shape::NotFinite;
    }
    let origin = place(0);
    let at = |k: usize| place(k) - origin;
    // Twice the areas; their sum is Newell's normal.
    let areas = || (1..count - 1).map(|k| at(k).cross(at(k + 1)));
    let normal: DVec3 = areas().sum();
    let diameter = (1..count).map(|k| at(k).length()).fold(0.0, f64::max);
    let area = normal.length();
    if area <= NO_AREA * diameter * diameter {
        // Nothing at all, or parts that cancel as in a bow tie.
        let parts: f64 = areas().map(DVec3::length).sum();
        return if parts <= 2.0 * NO_AREA.sqrt() * diameter * diameter { Shape::Plain } else { Shape::Crossing };
    }
    let height = (1..count).map(|k| at(k).dot(normal).abs()).fold(0.0, f64::max) / area;
    let shape = if height > WARPED * diameter { Shape::Warped } else { Shape::Plain };
    if is_covered_by_fan(count, at, normal) {
        return shape;
    }
    if let &[a, b, c, d] = corners {
        // One of the two diagonals of a quadrilateral is right.
        let from_second = |k: usize| place((k + 1) % 4) - place(1);
        if !is_covered_by_fan(4, from_second, normal) {
            return Shape::Crossing;
        }
        triangles.copy_from_slice(&[[b, c, d], [b, d, a]]);
        return shape;
    }
    let flat = flatten((0..count).map(at), normal, height > FLAT * diameter);
    let Some(found) = delaunay(&flat) else { return Shape::Crossing };
    // What repeated corners and spikes lack is filled up with triangles without area.
    let found = found.into_iter().chain(std::iter::repeat([0; 3]));
    for (slot, triangle) in triangles.iter_mut().zip(found) {
        *slot = triangle.map(|k| corners[k]);
    }
    shape
}

/// Whether the fan from corner 0 covers a polygon of `count` corners once, `at` measured from that corner: all its
/// triangles turn the same way, and together by less than a full turn.
fn is_covered_by_fan(count: usize, at: impl Fn(usize) -> DVec3, normal: DVec3) -> bool {
    let least = -SLACK * normal.length_squared();
    let first = at(1);
    let mut half_way = false;
    (1..count - 1).all(|k| {
        let (a, b) = (at(k), at(k + 1));
        let turn = a.cross(b).dot(normal);
        // The first corner on the edge opposite to it: a touch.
        let opposite = turn <= -least && a.dot(b) < 0.0;
        let side = first.cross(b).dot(normal);
        let full = half_way && side >= 0.0;
        half_way |= side < 0.0;
        turn >= least && !opposite && !full
    })
}

/// Height over diameter, without a unit, up to which rounding explains that corners do not lie in a plane.
const FLAT: f64 = 1e-9;

/// The corners in the plane, counterclockwise, the largest coordinate between 1/2 and 1. The axis that is nearest to
/// the normal is dropped, so that a plane polygon keeps its numbers; a warped one is projected along the normal first.
fn flatten(corners: impl Iterator<Item = DVec3>, normal: DVec3, project: bool) -> Vec<DVec2> {
    let size = normal.abs();
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(2);
    let (mut x, mut y) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        std::mem::swap(&mut x, &mut y);
    }
    let unit = normal / normal.length();
    let along = |p: DVec3| if project { p - unit * p.dot(unit) } else { p };
    let mut flat: Vec<DVec2> = corners.map(along).map(|p| DVec2::new(p[x], p[y])).collect();
    let largest = flat.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let scale = libm::ldexp(1.0, -libm::frexp(largest).1);
    // Below the least number that the triangulation takes there is only 0, and only one 0.
    let clean = |v: f64| if v.abs() < spade::MIN_ALLOWED_VALUE { 0.0 } else { v };
    flat.iter_mut().for_each(|p| *p = DVec2::new(clean(p.x * scale), clean(p.y * scale)));
    flat
}

/// The triangles of a simple polygon, counterclockwise, by numbers of its corners; `None` for one that crosses itself.
///
/// Corners at one place are one corner, and edges that are passed twice, such as those that lead to a hole, bound
/// nothing.
fn delaunay(flat: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let count = flat.len();
    let mut by_place: Vec<usize> = (0..count).collect();
    by_place.sort_by(|&a, &b| flat[a].x.total_cmp(&flat[b].x).then(flat[a].y.total_cmp(&flat[b].y)).then(a.cmp(&b)));
    let mut same: Vec<usize> = (0..count).collect();
    for pair in by_place.windows(2) {
        if flat[pair[0]] == flat[pair[1]] {
            same[pair[1]] = same[pair[0]];
        }
    }
    let kept: Vec<usize> = (0..count).filter(|&k| same[k] == k).collect();
    let number: Vec<usize> = same.iter().map(|k| kept.partition_point(|i| i < k)).collect();
    let mut edges: Vec<[usize; 2]> = (0..count)
        .map(|k| [number[k], number[(k + 1) % count]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .filter(|[a, b]| a != b)
        .collect();
    edges.sort_unstable();
    let odd = edges.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1).map(|same| same[0]).collect();

    let points = kept.iter().map(|&k| Point2::new(flat[k].x, flat[k].y)).collect();
    let mut crossing = false;
    let mesh: ConstrainedDelaunayTriangulation<Point2<f64>> =
        ConstrainedDelaunayTriangulation::try_bulk_load_cdt(points, odd, |_| crossing = true).ok()?;
    if crossing {
        return None;
    }
    let mut triangles: Vec<[usize; 3]> = inside(&mesh).into_iter().map(|t| t.map(|i| kept[i])).collect();
    // An order that follows from the polygon alone.
    for triangle in &mut triangles {
        let least = (0..3).min_by_key(|&i| triangle[i]).unwrap_or(0);
        triangle.rotate_left(least);
    }
    triangles.sort_unstable();
    let area = |[a, b, c]: [usize; 3]| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let covered: f64 = triangles.iter().copied().map(area).sum();
    let wanted: f64 = (1..count - 1).map(|k| area([0, k, k + 1])).sum();
    (triangles.len() <= count - 2 && (covered - wanted).abs() <= 1e-9 * wanted).then_some(triangles)
}

/// The triangles inside the constraint edges: an odd number of them lies between these and the outside.
fn inside(mesh: &ConstrainedDelaunayTriangulation<Point2<f64>>) -> Vec<[usize; 3]> {
    let mut seen = vec![false; mesh.num_all_faces()];
    // Of the two sides of an edge of the hull one is outside, which has no triangle.
    let mut ahead: Vec<_> = mesh
        .convex_hull()
        .flat_map(|edge| [edge, edge.rev()])
        .map(|edge| (edge.face(), edge.is_constraint_edge()))
        .collect();
    let mut found = Vec::new();
    while let Some((face, is_inside)) = ahead.pop() {
        let Some(face) = face.as_inner() else { continue };
        if std::mem::replace(&mut seen[face.index()], true) {
            continue;
        }
        if is_inside {
            found.push(face.vertices().map(|vertex| vertex.index()));
        }
        let neighbours = face.adjacent_edges().map(|edge| (edge.rev().face(), edge.is_constraint_edge() != is_inside));
        ahead.extend(neighbours);
    }
    found
}
