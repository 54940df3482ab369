use super::*;
use crate::random;
use alloc::vec::Vec;
use dashu_int::IBig;

const UNIT: Triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);

#[test]
fn weights_and_distance_follow_the_conventions() {
    let ray = Ray::new(Vec3::new(0.25, 0.5, 3.0), Vec3::new(0.0, 0.0, -2.0));
    let hit = hit(&ray, &UNIT, 7).expect("the ray points at the triangle");
    assert_eq!(hit, Hit { t: 1.5, u: 0.25, v: 0.5, primitive: 7 });
}

#[test]
fn limits_are_inclusive_and_bad_rays_miss() {
    let ray = Ray::new(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
    assert!(hit(&ray.with_range(1.0, 1.0), &UNIT, 0).is_some());
    assert!(hit(&ray.with_range(1.5, 2.0), &UNIT, 0).is_none());
    assert!(hit(&ray.with_range(2.0, 0.0), &UNIT, 0).is_none());
    assert!(hit(&ray.with_range(f32::NAN, 2.0), &UNIT, 0).is_none());
    assert!(hit(&Ray::new(ray.origin, Vec3::ZERO), &UNIT, 0).is_none());
    assert!(hit(&ray, &Triangle::new(Vec3::splat(f32::INFINITY), Vec3::X, Vec3::Y), 0).is_none());
    assert!(hit(&ray, &Triangle::new(Vec3::splat(f32::NAN), Vec3::X, Vec3::Y), 0).is_none());
}

#[test]
fn power_of_two_scaling_changes_no_bit_of_u_and_v() {
    let ray = Ray::new(Vec3::new(0.3, 0.1, 1.7), Vec3::new(0.03, 0.07, -1.3));
    let base = hit(&ray, &UNIT, 0).expect("aimed at it");
    for exponent in [-100, -3, 40, 100] {
        let s = libm::ldexpf(1.0, exponent);
        let scaled = Ray::new(ray.origin * s, ray.direction);
        let h = hit(&scaled, &UNIT.scaled(s), 0).expect("scaled");
        assert_eq!((h.t, h.u, h.v), (base.t * s, base.u, base.v), "2^{exponent}");
    }
}

/// Fails when a distance that vanishes is rounded to 0, which every limit of 0 accepts.
#[test]
fn what_is_behind_stays_behind_at_any_scale() {
    assert_eq!([-1e-60, 1e-60, 0.0, -0.0].map(round_distance).map(f32::to_bits), [0x8000_0001, 1, 0, 0]);
    let at = |z: f32| {
        let ray = Ray::new(Vec3::new(0.25, 0.25, z), Vec3::new(0.0, 0.0, -f32::MAX));
        hit(&ray, &UNIT, 0).map(|hit| hit.t)
    };
    assert_eq!([at(1e-30), at(-1e-30), at(0.0), at(-0.0)], [Some(LEAST), None, Some(0.0), Some(0.0)]);
}

// Fails when an origin in a triangle is hit at a rounded distance beside 0, or left out.
#[test]
fn an_origin_in_a_triangle_hits_it_at_zero() {
    let tilted = Triangle::new(Vec3::new(3.0, 0.0, 0.0), Vec3::new(0.0, 3.0, 0.0), Vec3::new(0.0, 0.0, 3.0));
    for origin in [[1.0, 1.0, 1.0], [0.5, 0.75, 1.75], [1.5, 1.5, 0.0], [3.0, 0.0, 0.0]] {
        for direction in [Vec3::new(0.1, 0.7, 0.3), Vec3::new(-1e-20, -1e20, 1e-3), Vec3::NEG_X] {
            let ray = Ray::new(Vec3::from(origin), direction);
            assert_eq!(hit(&ray, &tilted, 0).map(|hit| hit.t.to_bits()), Some(0), "{ray:?}");
            assert_eq!(hit(&ray.with_range(LEAST, 1.0), &tilted, 0), None, "{ray:?}");
            let off = Ray::new(ray.origin + Vec3::splat(1e-7), direction);
            assert_ne!(hit(&off.with_range(f32::NEG_INFINITY, 9.0), &tilted, 0).map(|hit| hit.t), Some(0.0));
        }
    }
}

// Double precision cannot tell this triangle of size 10⁻¹⁴ from a point on the ray, which passes it at 4.84 units.
// Fails without the bound on edge functions, and when exact arithmetic is not asked.
#[test]
fn a_tiny_triangle_beside_the_ray_is_not_hit() {
    let tiny = Triangle::new(
        Vec3::new(7.592_685e-15, 5.969_877e-15, 9.176_923e-15),
        Vec3::new(6.896_301_7e-15, 5.003_564_2e-15, 7.708_381e-16),
        Vec3::new(4.884_492e-15, 2.128_31e-15, 1.326_963e-15),
    );
    let to = tiny.vertices().map(|p| p.as_dvec3()).into_iter().sum::<DVec3>() / 3.0;
    for i in 0..200 {
        let from = 700.0 * Vec3::from(random::pcg3d([i, 1, 2]).map(random::unit)) + 100.0;
        for aside in [4.84, 1e-3, 1e-9, 1e-13] {
            let across = Vec3::from(random::pcg3d([i, 3, 4]).map(random::unit)) - 0.5;
            let toward = (to - from.as_dvec3()).as_vec3() + across * aside;
            assert_right(&Ray::new(from, toward), &tiny);
        }
    }
}

// Fails when a shared edge is decided twice differently, or when the vertex of a T-junction makes a gap.
#[test]
fn rays_at_shared_edges_and_exact_t_junctions_hit() {
    let [left, right, top] = [Vec3::new(-3.0, 1.0, 2.0), Vec3::new(5.0, -1.0, 4.0), Vec3::new(0.0, 7.0, 3.0)];
    let middle = (left + right) * 0.5;
    let bottom = Vec3::new(1.0, -6.0, 1.0);
    let triangles =
        [Triangle::new(left, right, top), Triangle::new(left, bottom, middle), Triangle::new(middle, bottom, right)];
    for i in 0..2_000 {
        let from = Vec3::new(0.5, 0.25, -9.0) + Vec3::from(random::pcg3d([i, 5, 6]).map(random::unit));
        let at = left + (right - left) * (1 + i % 63) as f32 / 64.0;
        let ray = Ray::new(from, at - from);
        assert!(triangles.iter().any(|triangle| hit(&ray, triangle, 0).is_some()), "{ray:?}");
        triangles.iter().for_each(|triangle| assert_right(&ray, triangle));
    }
}

/// Whole numbers of 2⁻¹⁴⁹.
fn whole(x: f32) -> IBig {
    let (bits, fraction) = (x.to_bits() & 0x7fff_ffff, x.to_bits() & 0x7f_ffff);
    let value = match bits >> 23 {
        0 => IBig::from(fraction),
        exponent => IBig::from(fraction | 0x80_0000) << (exponent - 1) as usize,
    };
    if x.is_sign_negative() { -value } else { value }
}

/// Whole numbers of 2⁻⁵⁰⁰, for numbers that are.
fn whole_f64(x: f64) -> IBig {
    let bits = x.to_bits();
    let mantissa = IBig::from((bits & 0xf_ffff_ffff_ffff) | 0x10_0000_0000_0000);
    let exponent = (bits >> 52 & 0x7ff) as i32 - 1075 + 500;
    let value = if exponent < 0 { mantissa >> -exponent as usize } else { mantissa << exponent as usize };
    if x < 0.0 { -value } else { value }
}

/// U, V and W, and what t is a multiple of them.
fn volumes(ray: &Ray, triangle: &Triangle) -> ([IBig; 3], IBig) {
    let [o, d, a, b, c] =
        [ray.origin, ray.direction, triangle.a, triangle.b, triangle.c].map(|p| p.to_array().map(whole));
    let [a, b, c] = [a, b, c].map(|p| [0, 1, 2].map(|i| &p[i] - &o[i]));
    let volume = |p: &[IBig; 3], q: &[IBig; 3], r: &[IBig; 3]| {
        [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
            .map(|(i, j, k)| &p[i] * (&q[j] * &r[k] - &q[k] * &r[j]))
            .into_iter()
            .sum::<IBig>()
    };
    ([volume(&d, &b, &c), volume(&d, &c, &a), volume(&d, &a, &b)], volume(&a, &b, &c))
}

/// Compares a hit with the definition, in whole numbers, in the file's coordinates and in others.
fn assert_right(ray: &Ray, triangle: &Triangle) {
    let (edges, depth) = volumes(ray, triangle);
    let zero = IBig::ZERO;
    let one_sign = edges.iter().all(|e| *e >= zero) || edges.iter().all(|e| *e <= zero);
    let mut determinant: IBig = edges.iter().sum();
    let everywhere = ray.with_range(f32::NEG_INFINITY, f32::INFINITY);
    let found = hit(&everywhere, triangle, 0);
    for exponent in [-100, -7, 30, 120] {
        let Some(scaled) = rescaled(triangle, exponent) else { continue };
        for reach in [f64::INFINITY, reach_of(ray, triangle) * pow2(-exponent)] {
            let again = Shear::new(ray, exponent, reach).hit(&scaled, [f32::NEG_INFINITY, f32::INFINITY], 0);
            let bits = |hit: Option<Hit>| hit.map(|h| [h.t, h.u, h.v].map(f32::to_bits));
            assert_eq!(bits(again), bits(found), "{ray:?}, {triangle:?}, 2^{exponent}");
        }
    }
    if !one_sign || determinant == zero {
        assert_eq!(found, None, "{ray:?}, {triangle:?}");
        return;
    }
    let mut depth = depth;
    if determinant < zero {
        (depth, determinant) = (-depth, -determinant);
    }
    let met = Shear::new(ray, 0, f64::INFINITY).intersect(triangle).expect("the line meets it");
    if met.t.abs() > 1e-50 && met.t.abs() < 1e50 {
        let [low, high] = [met.t - met.error, met.t + met.error].map(|t| whole_f64(t) * &determinant);
        let exact = &depth << 500;
        assert!(low <= exact && exact <= high, "{ray:?}, {triangle:?}: {met:?}");
    }
    // Half the last step between finite numbers: from here on, distances are rounded to infinity.
    let beyond = |t: &IBig| *t >= ((IBig::from(1) << 25) - 1) << (128_usize - 25 + 149);
    let Some(hit) = found else {
        let magnitude = if depth < zero { -depth } else { depth };
        assert!(beyond(&((magnitude << 149) / determinant)), "a miss: {ray:?}, {triangle:?}");
        return;
    };
    // In units of 2⁻¹⁵⁰, so that what is halfway between two numbers is whole.
    let exact = depth << 150;
    let at = |t: f32| whole(t);
    let (below, above) =
        (at(hit.t) + at(hit.t.next_down().max(f32::MIN)), at(hit.t) + at(hit.t.next_up().min(f32::MAX)));
    let even = hit.t.to_bits() & 1 == 0;
    let (above, below) = (above * &determinant, below * &determinant);
    if hit.t == 0.0 {
        assert_eq!((&exact, hit.t.to_bits()), (&zero, 0), "{ray:?}, {triangle:?}");
    } else {
        let largest = hit.t.abs() == f32::MAX;
        let vanishes = hit.t.abs() == LEAST;
        assert!((exact > zero) == (hit.t > 0.0), "{ray:?}, {triangle:?}: {hit:?}");
        if !(largest && hit.t > 0.0 || vanishes && hit.t < 0.0) {
            assert!(exact < above || even && exact == above, "{ray:?}, {triangle:?}: {hit:?}");
        }
        if !(largest && hit.t < 0.0 || vanishes && hit.t > 0.0) {
            assert!(exact > below || even && exact == below, "{ray:?}, {triangle:?}: {hit:?}");
        }
    }
    // The weights are right to a few of their last places where those count for most.
    let share = |edge: &IBig| {
        let magnitude = if *edge < zero { -edge.clone() } else { edge.clone() };
        ((magnitude << 60) / &determinant).to_f64().value() / pow2(60)
    };
    for (weight, edge) in [(hit.u, &edges[1]), (hit.v, &edges[2])] {
        assert!((f64::from(weight) - share(edge)).abs() < 1.6e-7, "{ray:?}, {triangle:?}: {hit:?}");
    }
}

fn reach_of(ray: &Ray, triangle: &Triangle) -> f64 {
    let distances = triangle.vertices().map(|p| (p.as_dvec3() - ray.origin.as_dvec3()).abs().max_element());
    distances.into_iter().fold(0.0, f64::max)
}

/// The triangle in another unit, if that loses no bit.
fn rescaled(triangle: &Triangle, exponent: i32) -> Option<Triangle> {
    let to = |p: Vec3| {
        let q = (p.as_dvec3() * pow2(-exponent)).as_vec3();
        (q.is_finite() && q.as_dvec3() * pow2(exponent) == p.as_dvec3()).then_some(q)
    };
    Some(Triangle::new(to(triangle.a)?, to(triangle.b)?, to(triangle.c)?))
}

/// Coordinates that make trouble: small whole numbers, so that edges, planes and draws are met exactly; few bits at
/// far-apart magnitudes; any number at all.
fn coordinate(kind: u32, bits: [u32; 3]) -> f32 {
    let [value, size, sign] = bits;
    let fraction = f32::from_bits(0x3f80_0000 | value >> 9);
    let signed = if sign & 1 == 0 { fraction } else { -fraction };
    let power = |range: u32, least: i32| libm::ldexpf(1.0, (size % range) as i32 + least);
    match kind {
        0 => (value % 9) as f32 - 4.0,
        1 => ((value % 65) as f32 - 32.0) / 16.0,
        2 => signed,
        3 => signed * power(40, -40),
        4 => signed + (value % 3) as f32 * power(24, 0),
        5 => libm::truncf(signed * 4.0) * power(200, -120),
        _ => f32::from_bits(value & !(1 << (23 + size % 8))),
    }
}

/// Rays at triangles of [`coordinate`]s: many in the plane, through vertices and edges, and from points of it.
fn troubled(seed: u32) -> (Ray, Triangle) {
    let [kinds, way, mix] = random::pcg3d([seed, 7, 0]);
    let point = |index: u32| {
        let kind = if mix % 4 == 0 { (kinds >> (3 * index)) % 7 } else { kinds % 7 };
        Vec3::from([0, 1, 2].map(|axis| coordinate(kind, random::pcg3d([seed, index, axis]))))
    };
    let [a, b, c, o, d] = [1, 2, 3, 4, 5].map(point);
    let origin = match way % 5 {
        0 => a + (b - a) * 0.5,
        1 => a,
        _ => o,
    };
    let target = match way / 8 % 6 {
        0 => a,
        1 => (a + b) * 0.5,
        2 => (a + b + c) / 3.0,
        3 => a * 0.5 + (b + c) * 0.25,
        _ => origin + d,
    };
    let direction = if target - origin == Vec3::ZERO { d } else { target - origin };
    (Ray::new(origin, direction), Triangle::new(a, b, c))
}

// Fails when the bounds on edge functions or on distances are a thirtieth of what they are, when a draw is not rounded
// to even, when exact arithmetic decides a sign with another of the volumes, and when either test depends on the unit.
#[test]
fn hits_are_those_of_whole_numbers() {
    let (mut tried, mut hits, mut at_zero) = (0, 0, 0);
    for seed in 0..60_000 {
        let (ray, triangle) = troubled(seed);
        if !ray.is_valid() || !triangle.is_finite() {
            continue;
        }
        assert_right(&ray, &triangle);
        let found = hit(&ray.with_range(f32::NEG_INFINITY, f32::INFINITY), &triangle, 0);
        (tried, hits) = (tried + 1, hits + u32::from(found.is_some()));
        at_zero += u32::from(found.is_some_and(|hit| hit.t == 0.0));
    }
    assert!(tried > 40_000 && hits > 10_000 && at_zero > 1_000, "{tried} {hits} {at_zero}");
}

#[test]
fn areas_are_those_of_whole_numbers() {
    let mut without = 0;
    for seed in 0..20_000 {
        let (_, Triangle { a, b, c }) = troubled(seed);
        // Some on a line, as exactly as single precision can say.
        let c = if seed % 3 == 0 { a + (b - a) * [0.5, 2.0, -4.0][seed as usize / 3 % 3] } else { c };
        let triangle = Triangle::new(a, b, c);
        if !triangle.is_finite() {
            continue;
        }
        let [a, b, c] = triangle.vertices().map(|p| p.to_array().map(whole));
        let [p, q] = [b, c].map(|x| [0, 1, 2].map(|i| &x[i] - &a[i]));
        let flat = [(1, 2), (2, 0), (0, 1)].iter().all(|&(j, k)| &p[j] * &q[k] == &p[k] * &q[j]);
        assert_eq!(has_area(&triangle), !flat, "{triangle:?}");
        without += u32::from(flat);
    }
    assert!(without > 1_000, "{without}");
}

// What a distance is rounded to where it lies exactly halfway between two numbers, from a table.
#[test]
fn draws_are_rounded_to_even() {
    let draws: Vec<(f32, f32)> = [(16_777_217.0, 16_777_216.0), (16_777_219.0, 16_777_220.0)]
        .map(|(t, r): (f64, f32)| {
            // The distance is t: from −t/2 to t/2, rounded coordinates being exact halves.
            ((t / 2.0 - 0.5) as f32, r)
        })
        .to_vec();
    for (z, expected) in draws {
        // From below 0 by z + 1 to z: 2z + 1 units in single steps.
        let ray = Ray::new(Vec3::new(0.25, 0.25, -z - 1.0), Vec3::Z);
        let triangle = Triangle::new(Vec3::new(0.0, 0.0, z), Vec3::new(1.0, 0.0, z), Vec3::new(0.0, 1.0, z));
        assert_eq!(hit(&ray, &triangle, 0).map(|hit| hit.t), Some(expected));
    }
}
