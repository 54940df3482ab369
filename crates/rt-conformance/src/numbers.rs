//! Cases about the extremes of the number range.

use crate::Case;
use crate::fixtures::{self, Fixture};
use crate::need::had;
use crate::session::{Session, ensure, same_hits};
use glam::Vec3;
use rt_core::{Device, Hit, Precision, Query, Ray, StreamSpec, Triangle};
use rt_verify::rays::RayMaker;
use rt_verify::shapes;

pub(crate) const CASES: &[Case] = &[
    Case { name: "invalid_rays_miss", needs: &[], run: invalid_rays_miss },
    Case {
        name: "scaling_by_powers_of_two_changes_nothing",
        needs: &[],
        run: scaling_by_powers_of_two_changes_nothing,
    },
    Case { name: "directions_have_any_length", needs: &[], run: directions_have_any_length },
    Case { name: "signs_of_zero_do_not_matter", needs: &[], run: signs_of_zero_do_not_matter },
    Case { name: "offsets_of_a_million_are_right", needs: &[], run: offsets_of_a_million_are_right },
    Case { name: "triangles_without_area_are_never_hit", needs: &[], run: triangles_without_area_are_never_hit },
];

fn invalid_rays_miss(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::named("sphere")?;
    let good = Ray::new(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 2.0, -3.0));
    let mut rays = vec![
        Ray::new(good.origin, Vec3::ZERO),
        Ray::new(good.origin, Vec3::splat(-0.0)),
        good.with_range(1.0, 0.5),
        good.with_range(f32::INFINITY, 0.0),
        good.with_range(f32::NAN, f32::INFINITY),
        good.with_range(0.0, f32::NAN),
        good.with_range(0.0, -1.0),
    ];
    for poison in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut origin, mut direction) = (good, good);
            origin.origin[axis] = poison;
            direction.direction[axis] = poison;
            rays.extend([origin, direction]);
        }
    }
    // A valid ray among them must not suffer.
    let rays: Vec<_> = rays.into_iter().flat_map(|ray| [(ray, u32::MAX), (good, u32::MAX)]).collect();
    for precision in had(device, Precision::ALL) {
        for query in [Query::Closest, Query::Any] {
            let spec = StreamSpec::new(query, precision, false);
            let launch = Session::whole(device, &fixture.scene, &rays, spec)?;
            for (pair, rays) in launch.hits.chunks(2).zip(rays.chunks(2)) {
                ensure!(pair[0] == Hit::MISS, "{precision:?}, {query:?}: {:?} hits: {:?}", rays[0].0, pair[0]);
                ensure!(pair[1].is_hit(), "{precision:?}, {query:?}: a valid ray beside {:?} misses", rays[0].0);
            }
        }
    }
    Ok(())
}

fn scaling_by_powers_of_two_changes_nothing(device: &dyn Device) -> Result<(), String> {
    let base = fixtures::named("sphere")?;
    // Halves of the rays' and triangles' bits must survive 2^±100: coordinates below 2⁻²⁶ would become subnormal.
    let coarse = |p: Vec3| (p * 1024.0).round() / 1024.0;
    let triangles: Vec<Triangle> =
        base.triangles.iter().map(|t| Triangle::new(coarse(t.a), coarse(t.b), coarse(t.c))).collect();
    let rays: Vec<(Ray, u32)> = base.rays.iter().map(|(r, o)| (Ray::new(coarse(r.origin), r.direction), *o)).collect();
    let unit = Fixture::new("unit", triangles, rays)?;
    let spec = StreamSpec::default();
    let expected = Session::whole(device, &unit.scene, &unit.rays, spec)?.hits;
    for exponent in [-100, -7, 1, 100] {
        let factor = 2.0_f32.powi(exponent);
        let triangles = unit.triangles.iter().map(|t| t.scaled(factor)).collect();
        let rays = unit.rays.iter().map(|(r, o)| (Ray::new(r.origin * factor, r.direction), *o)).collect();
        let scaled = Fixture::new("scaled", triangles, rays)?;
        let hits = Session::whole(device, &scaled.scene, &scaled.rays, spec)?.hits;
        let back: Vec<Hit> = hits.iter().map(|hit| Hit { t: hit.t / factor, ..*hit }).collect();
        same_hits(&format!("scale 2^{exponent}"), &back, &expected)?;
    }
    Ok(())
}

fn directions_have_any_length(device: &dyn Device) -> Result<(), String> {
    let base = fixtures::named("soup")?;
    for factor in [1e-30_f32, 1e-7, 1e5, 1e30] {
        let stretch = |&(ray, origin): &(Ray, u32)| (Ray::new(ray.origin, ray.direction * factor), origin);
        let fixture = Fixture::new("soup", base.triangles.clone(), base.rays.iter().map(stretch).collect())?;
        for precision in had(device, [Precision::Robust, Precision::Double]) {
            let spec = StreamSpec { precision, ..StreamSpec::default() };
            let hits = Session::whole(device, &fixture.scene, &fixture.rays, spec)?.hits;
            for ((hit, verdict), (ray, _)) in hits.iter().zip(&fixture.verdicts).zip(&fixture.rays) {
                ensure!(verdict.is_right(hit), "{precision:?}: {ray:?}: {hit:?}, but {verdict}");
            }
        }
    }
    Ok(())
}

fn signs_of_zero_do_not_matter(device: &dyn Device) -> Result<(), String> {
    // Cut so that the rays run along edges of boxes and triangles.
    let triangles = shapes::moved(&shapes::grid(8, 0.0, 0), Vec3::new(-0.5, 0.0, -0.5));
    let ray = |i: u32, zero: f32| {
        let at = |k: u32| k as f32 / 8.0 - 0.5;
        let (x, z) = (at(i % 9), at(i / 9));
        let clean = |v: f32| if v == 0.0 { zero } else { v };
        let down = Ray::new(Vec3::new(clean(x), 1.0, clean(z)), Vec3::new(zero, -1.0, zero));
        (down, u32::MAX)
    };
    let positive = Fixture::new("zeros", triangles, (0..81).map(|i| ray(i, 0.0)).collect())?;
    let negative: Vec<_> = (0..81).map(|i| ray(i, -0.0)).collect();
    let spec = StreamSpec::default();
    let expected = Session::whole(device, &positive.scene, &positive.rays, spec)?.hits;
    ensure!(expected.iter().all(Hit::is_hit), "a ray along an axis fell through a plane");
    let found = Session::whole(device, &positive.scene, &negative, spec)?.hits;
    for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
        ensure!(a.primitive == b.primitive && a.t == b.t, "ray {i}: {a:?} with -0, {b:?} with +0");
    }
    Ok(())
}

fn offsets_of_a_million_are_right(device: &dyn Device) -> Result<(), String> {
    for offset in [Vec3::new(1e6, 0.0, 0.0), Vec3::new(-1e6, 1e6, 1e6)] {
        let triangles = shapes::moved(&shapes::grid(10, 0.5, 3), offset);
        let mut rays = RayMaker::new(&triangles, 4).mixed(300);
        // And from the origin, a million away.
        let far = |t: &Triangle| (Ray::new(Vec3::ZERO, t.a + (t.b - t.a) * 0.25 + (t.c - t.a) * 0.25), u32::MAX);
        rays.extend(triangles.iter().map(far));
        let fixture = Fixture::new("offset", triangles, rays)?;
        let hits = Session::whole(device, &fixture.scene, &fixture.rays, StreamSpec::default())?.hits;
        for ((hit, verdict), (ray, _)) in hits.iter().zip(&fixture.verdicts).zip(&fixture.rays) {
            ensure!(verdict.is_right(hit), "{offset}: {ray:?}: {hit:?}, but {verdict}");
        }
    }
    Ok(())
}

fn triangles_without_area_are_never_hit(device: &dyn Device) -> Result<(), String> {
    let [p, q] = [Vec3::new(0.25, 0.5, 0.75), Vec3::new(2.25, 1.5, 1.75)];
    let flat = [Triangle::new(p, p, p), Triangle::new(p, q, q), Triangle::new(p, q, (p + q) * 0.5)];
    let triangles: Vec<_> = flat.into_iter().chain(shapes::soup(5, 0.1, 8)).collect();
    let aims = [p, q, (p + q) * 0.5, p + (q - p) * 0.25];
    let from = |i: u32| Vec3::new((i % 5) as f32, (i % 7) as f32 - 3.0, -5.0 + (i % 11) as f32);
    let rays = (0..200).map(|i| (Ray::new(from(i), aims[i as usize % 4] - from(i)), u32::MAX)).collect();
    let fixture = Fixture::new("no area", triangles, rays)?;
    for precision in had(device, Precision::ALL) {
        let spec = StreamSpec { precision, ..StreamSpec::default() };
        let hits = Session::whole(device, &fixture.scene, &fixture.rays, spec)?.hits;
        ensure!(hits.iter().all(|h| !h.is_hit() || h.primitive >= 3), "{precision:?}: hit a triangle without area");
    }
    Ok(())
}
