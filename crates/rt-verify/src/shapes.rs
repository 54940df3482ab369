//! Triangles that make trouble, and some that make none: the scenes of the conformance suite and the properties.

use core::f32::consts::TAU;
use glam::Vec3;
use rt_core::{Triangle, random};

/// `count` triangles of edge length up to `size` at random places in the unit cube.
#[must_use]
pub fn soup(count: u32, size: f32, seed: u32) -> Vec<Triangle> {
    let triangle = |i| {
        let centre = point(seed, i, 0);
        let [a, b, c] = [1, 2, 3].map(|k| centre + (point(seed, i, k) - 0.5) * size);
        Triangle::new(a, b, c)
    };
    (0..count).map(triangle).collect()
}

/// A height field over the unit square of `side × side` cells, two triangles each: every edge but the border's is
/// shared, most vertices by six. Flat where `height` is 0.
#[must_use]
pub fn grid(side: u32, height: f32, seed: u32) -> Vec<Triangle> {
    let vertex = |x: u32, z: u32| {
        let [bump, _] = random::pair(seed, z * (side + 1) + x, 0);
        Vec3::new(x as f32 / side as f32, bump * height, z as f32 / side as f32)
    };
    let cell = |i: u32| {
        let (x, z) = (i % side, i / side);
        let [a, b, c, d] = [vertex(x, z), vertex(x + 1, z), vertex(x + 1, z + 1), vertex(x, z + 1)];
        [Triangle::new(a, b, c), Triangle::new(a, c, d)]
    };
    (0..side * side).flat_map(cell).collect()
}

/// A closed sphere of radius 1 around the origin: an icosahedron whose faces were quartered `levels` times, so
/// `20 · 4^levels` triangles.
#[must_use]
pub fn icosphere(levels: u32) -> Vec<Triangle> {
    const FACES: [[usize; 3]; 20] = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let g = f32::midpoint(1.0, 5.0_f32.sqrt());
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let corners = corners.map(|c| Vec3::from(c).normalize());
    let mut faces: Vec<Triangle> = FACES.map(|[a, b, c]| Triangle::new(corners[a], corners[b], corners[c])).to_vec();
    for _ in 0..levels {
        // The middle of an edge is the same bits from both of its triangles, since addition commutes.
        let middle = |p: Vec3, q: Vec3| (p + q).normalize();
        let quarter = |Triangle { a, b, c }: &Triangle| {
            let [ab, bc, ca] = [middle(*a, *b), middle(*b, *c), middle(*c, *a)];
            [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]].map(|[a, b, c]| Triangle::new(a, b, c))
        };
        faces = faces.iter().flat_map(quarter).collect();
    }
    faces
}

/// A closed cube of half edge 1 around the origin, each face a grid of `side × side` cells with two triangles each. Its
/// vertices lie on a lattice, exact where `side` is a power of two.
#[must_use]
pub fn box_grid(side: u32) -> Vec<Triangle> {
    let at = |i: u32| 2.0 * i as f32 / side as f32 - 1.0;
    let face = |axis: usize, end: u32| {
        let corner = move |i: u32, j: u32| {
            let mut cell = [at(end); 3];
            (cell[(axis + 1) % 3], cell[(axis + 2) % 3]) = (at(i), at(j));
            Vec3::from(cell)
        };
        (0..side * side).flat_map(move |cell| {
            let (i, j) = (cell % side, cell / side);
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [Triangle::new(a, b, c), Triangle::new(a, c, d)]
        })
    };
    (0..3).flat_map(|axis| [0, side].into_iter().flat_map(move |end| face(axis, end))).collect()
}

/// Radius of the tube of [`torus`], whose ring has radius 1.
pub const TORUS_TUBE: f32 = 0.4;

/// A closed torus in the plane of x and z around the origin: a ring of radius 1 with a tube of radius [`TORUS_TUBE`],
/// of `around × across` cells with two triangles each.
#[must_use]
pub fn torus(around: u32, across: u32) -> Vec<Triangle> {
    let vertex = |i: u32, j: u32| {
        // Whole turns come back to the same bits.
        let [(ring_sin, ring_cos), (sin, cos)] =
            [(i, around), (j, across)].map(|(k, n)| (TAU * (k % n) as f32 / n as f32).sin_cos());
        let out = 1.0 + TORUS_TUBE * cos;
        Vec3::new(out * ring_cos, TORUS_TUBE * sin, out * ring_sin)
    };
    let cell = |cell: u32| {
        let (i, j) = (cell % around, cell / around);
        let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
        [Triangle::new(a, b, c), Triangle::new(a, c, d)]
    };
    (0..around * across).flat_map(cell).collect()
}

/// `count` slivers of length about 1 and the given width: hair, and what tessellators leave behind.
#[must_use]
pub fn needles(count: u32, width: f32, seed: u32) -> Vec<Triangle> {
    let needle = |i| {
        let (root, along, aside) = (point(seed, i, 0), point(seed, i, 1) - 0.5, point(seed, i, 2) - 0.5);
        Triangle::new(root, root + along, root + along + aside * width)
    };
    (0..count).map(needle).collect()
}

/// The same `side × side` flat grid `layers` times in one plane: every hit is a tie, which the lowest id must win.
#[must_use]
pub fn layers(side: u32, layers: u32) -> Vec<Triangle> {
    (0..layers).flat_map(|_| grid(side, 0.0, 0)).collect()
}

/// `count` triangles whose sizes and distances from the origin run from 10⁻⁶ to 10⁶.
#[must_use]
pub fn mixed_scales(count: u32, seed: u32) -> Vec<Triangle> {
    let triangle = |(i, t): (usize, Triangle)| t.scaled(10.0_f32.powi(i as i32 % 13 - 6));
    soup(count, 0.5, seed).into_iter().enumerate().map(triangle).collect()
}

/// `count` triangles of size 10⁻³⁰ around the origin, of size 1 and of size 3·10³⁸, in turn: more magnitudes than a
/// unit can be chosen for.
#[must_use]
pub fn far_apart(count: u32, seed: u32) -> Vec<Triangle> {
    // Coordinates of the soup are at most 1.25 times that.
    const SIZES: [f32; 3] = [1e-30, 1.0, 2.7e38];
    soup(count, 0.5, seed).into_iter().enumerate().map(|(i, t)| t.scaled(SIZES[i % 3])).collect()
}

/// `count` triangles of size 10⁻¹⁴ around the origin before a square of half edge 50, and one triangle at 10⁷ that
/// makes the scene large: double precision cannot tell the small ones from points when it looks from some hundred units
/// away.
#[must_use]
pub fn tiny_and_far(count: u32, seed: u32) -> Vec<Triangle> {
    let [a, b, c, d] = [[-50.0, -50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, 50.0]].map(|[x, y]| Vec3::new(x, y, -2.0));
    let [p, q, r] = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, -1.0) * 1e7);
    let tiny = soup(count, 1.0, seed).into_iter().map(|t| t.scaled(1e-14));
    [Triangle::new(a, b, c), Triangle::new(a, c, d), Triangle::new(p, q, r)].into_iter().chain(tiny).collect()
}

/// A height field of `side × side` cells of size 10⁻⁴, one vertex of which says "no data", as files of terrain do.
#[must_use]
pub fn no_data(side: u32, seed: u32) -> Vec<Triangle> {
    let mut triangles: Vec<Triangle> = grid(side, 0.2, seed).iter().map(|t| t.scaled(1e-4)).collect();
    let hole = triangles[triangles.len() / 2].a;
    for triangle in &mut triangles {
        for corner in [&mut triangle.a, &mut triangle.b, &mut triangle.c] {
            if *corner == hole {
                corner.y = 3.4e38;
            }
        }
    }
    triangles
}

/// `count` triangles whose coordinates are whole numbers from −4 to 4: edges, planes and corners coincide exactly.
#[must_use]
pub fn lattice(count: u32, seed: u32) -> Vec<Triangle> {
    let corner = |i, k| (point(seed, i, k) * 9.0).floor() - 4.0;
    (0..count).map(|i| Triangle::new(corner(i, 0), corner(i, 1), corner(i, 2))).collect()
}

/// A closed cube of half edge 1 whose faces are grids of 2, 4 and 8 cells by axis: where they meet, vertices of one lie
/// on edges of the other, exactly.
#[must_use]
pub fn junctions() -> Vec<Triangle> {
    let grids = [2, 4, 8].map(box_grid);
    // The faces come by axis, both ends of each.
    grids
        .into_iter()
        .zip(0..3)
        .flat_map(|(grid, axis)| {
            let face = grid.len() / 3;
            grid.into_iter().skip(axis * face).take(face)
        })
        .collect()
}

/// A fan of `count` triangles around one vertex: many edges end in a point that all share.
#[must_use]
pub fn fan(count: u32) -> Vec<Triangle> {
    let rim = |i: u32| {
        let (sin, cos) = (TAU * (i % count) as f32 / count as f32).sin_cos();
        Vec3::new(cos, 0.1 * sin * cos, sin)
    };
    (0..count).map(|i| Triangle::new(Vec3::ZERO, rim(i), rim(i + 1))).collect()
}

/// Every vertex moved by `offset`.
#[must_use]
pub fn moved(triangles: &[Triangle], offset: Vec3) -> Vec<Triangle> {
    triangles.iter().map(|t| Triangle::new(t.a + offset, t.b + offset, t.c + offset)).collect()
}

fn point(seed: u32, index: u32, dimension: u32) -> Vec3 {
    Vec3::from(random::pcg3d([seed, index, dimension]).map(random::unit))
}
