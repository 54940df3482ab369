//! Cases about which hit a ray has.

use crate::Case;
use crate::fixtures::{self, Fixture};
use crate::need::{Need, had};
use crate::session::{Session, ensure, same_hits};
use glam::Vec3;
use rt_core::{Device, Hit, Precision, Query, Ray, StreamSpec, Triangle, intersect};
use rt_verify::rays::{Aim, RayMaker};
use rt_verify::reference::Reference;
use rt_verify::{brute, shapes};

pub(crate) const CASES: &[Case] = &[
    Case { name: "equals_brute_force", needs: &[], run: equals_brute_force },
    Case { name: "any_hit_equals_brute_force", needs: &[], run: any_hit_equals_brute_force },
    Case { name: "fast_is_nearly_right", needs: &[Need::Precision(Precision::Fast)], run: fast_is_nearly_right },
    Case { name: "reports_the_defined_bits", needs: &[Need::DefinedBits], run: reports_the_defined_bits },
    Case { name: "lowest_id_wins_ties", needs: &[], run: lowest_id_wins_ties },
    Case { name: "closed_sphere_does_not_leak", needs: &[], run: closed_sphere_does_not_leak },
    Case { name: "origin_primitive_is_left_out", needs: &[], run: origin_primitive_is_left_out },
    Case { name: "limits_are_inclusive", needs: &[Need::DefinedBits], run: limits_are_inclusive },
];

/// The precisions that promise right hits.
const RIGHT: [Precision; 2] = [Precision::Robust, Precision::Double];

/// Share of mixed rays that [`Precision::Fast`] may get wrong. It leaks on the edges and vertices that a third of these
/// rays are aimed at.
const FAST_WRONG: f64 = 0.4;

/// The same for rays at the inside of triangles.
const FAST_WRONG_INSIDE: f64 = 0.02;

fn spec(query: Query, precision: Precision) -> StreamSpec {
    StreamSpec::new(query, precision, false)
}

fn equals_brute_force(device: &dyn Device) -> Result<(), String> {
    for fixture in fixtures::all()? {
        for precision in had(device, RIGHT) {
            let spec = spec(Query::Closest, precision);
            let launch = Session::whole(device, &fixture.scene, &fixture.rays, spec)?;
            check_closest(fixture, precision, &launch.hits)?;
        }
    }
    Ok(())
}

fn check_closest(fixture: &Fixture, precision: Precision, hits: &[Hit]) -> Result<(), String> {
    for (i, (hit, verdict)) in hits.iter().zip(&fixture.verdicts).enumerate() {
        ensure!(
            verdict.is_right(hit),
            "{}, {precision:?}, ray {i} {:?}: {hit:?}, but {verdict}; brute force says {:?}",
            fixture.name,
            fixture.rays[i],
            fixture.hits[i]
        );
        ensure!(hit.is_hit() || *hit == Hit::MISS, "{}, ray {i}: a miss must be Hit::MISS, not {hit:?}", fixture.name);
    }
    Ok(())
}

fn any_hit_equals_brute_force(device: &dyn Device) -> Result<(), String> {
    for fixture in fixtures::all()? {
        let reference = Reference::new(&fixture.triangles);
        for precision in had(device, RIGHT) {
            let launch = Session::whole(device, &fixture.scene, &fixture.rays, spec(Query::Any, precision))?;
            for (i, (hit, (ray, origin))) in launch.hits.iter().zip(&fixture.rays).enumerate() {
                ensure!(
                    reference.is_right_any(ray, *origin, hit),
                    "{}, {precision:?}, ray {i} {ray:?}: {hit:?} is not a hit of it",
                    fixture.name
                );
            }
        }
    }
    Ok(())
}

fn fast_is_nearly_right(device: &dyn Device) -> Result<(), String> {
    for fixture in [fixtures::named("terrain")?, fixtures::named("soup")?, fixtures::named("sphere")?] {
        let spec = spec(Query::Closest, Precision::Fast);
        let launch = Session::whole(device, &fixture.scene, &fixture.rays, spec)?;
        let wrong: Vec<usize> = (0..fixture.rays.len())
            .filter(|&i| !fixture.verdicts[i].is_ambiguous() && launch.hits[i].primitive != fixture.hits[i].primitive)
            .collect();
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let (wrong, rays) = (wrong.len(), fixture.rays.len());
        ensure!(share(wrong, rays) <= FAST_WRONG, "{}: {wrong} of {rays} rays wrong", fixture.name);
        let maker = RayMaker::new(&fixture.triangles, 12);
        let rays: Vec<_> = (0..200).map(|i| maker.ray(Aim::Interior, i)).collect();
        let launch = Session::whole(device, &fixture.scene, &rays, spec)?;
        let expected = rays.iter().map(|(ray, origin)| brute::closest(&fixture.triangles, ray, *origin));
        let wrong = launch.hits.iter().zip(expected).filter(|(a, b)| a.primitive != b.primitive).count();
        ensure!(share(wrong, rays.len()) <= FAST_WRONG_INSIDE, "{}: {wrong} of 200 rays wrong", fixture.name);
    }
    Ok(())
}

fn reports_the_defined_bits(device: &dyn Device) -> Result<(), String> {
    for fixture in fixtures::all()? {
        for query in [Query::Closest, Query::Any] {
            for precision in had(device, RIGHT) {
                let launch = Session::whole(device, &fixture.scene, &fixture.rays, spec(query, precision))?;
                let defined = |(hit, (ray, _)): (&Hit, &(Ray, u32))| {
                    let triangle = fixture.triangles.get(hit.primitive as usize);
                    triangle.and_then(|t| intersect::hit(ray, t, hit.primitive)).unwrap_or(Hit::MISS)
                };
                let expected: Vec<Hit> = launch.hits.iter().zip(&fixture.rays).map(defined).collect();
                same_hits(&format!("{}, {query:?}, {precision:?}", fixture.name), &launch.hits, &expected)?;
            }
        }
    }
    Ok(())
}

/// Dyadic coordinates and rays along an axis: all arithmetic is exact, so every device sees the same ties.
fn lowest_id_wins_ties(device: &dyn Device) -> Result<(), String> {
    let once = shapes::grid(4, 0.0, 0);
    let turned = once.iter().map(|t| Triangle::new(t.b, t.c, t.a));
    let triangles: Vec<_> = once.iter().rev().copied().chain(turned).chain(once.iter().copied()).collect();
    let down = |i: u32| {
        let at = Vec3::new((i % 17) as f32 / 16.0, 1.0, (i / 17) as f32 / 16.0);
        (Ray::new(at, Vec3::NEG_Y), u32::MAX)
    };
    let fixture = Fixture::new("ties", triangles, (0..17 * 17).map(down).collect())?;
    for precision in had(device, RIGHT) {
        let launch = Session::whole(device, &fixture.scene, &fixture.rays, spec(Query::Closest, precision))?;
        ensure!(launch.hits.iter().all(Hit::is_hit), "a ray fell through a closed plane");
        same_hits(&format!("{precision:?}"), &launch.hits, &fixture.hits)?;
    }
    Ok(())
}

fn closed_sphere_does_not_leak(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::named("sphere")?;
    let mut rays = Vec::new();
    for t in &fixture.triangles {
        let targets = [t.a, t.b, t.c, (t.a + t.b) * 0.5, t.b + (t.c - t.b) * 0.3];
        rays.extend(targets.map(|p| (Ray::new(Vec3::ZERO, p), u32::MAX)));
    }
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        rays.extend([axis, -axis].map(|d| (Ray::new(Vec3::ZERO, d), u32::MAX)));
        rays.extend([axis, -axis].map(|d| (Ray::new(Vec3::splat(-0.0), d + Vec3::splat(-0.0)), u32::MAX)));
    }
    for precision in had(device, RIGHT) {
        for query in [Query::Closest, Query::Any] {
            let launch = Session::whole(device, &fixture.scene, &rays, spec(query, precision))?;
            let leaks = launch.hits.iter().filter(|hit| !hit.is_hit()).count();
            ensure!(leaks == 0, "{precision:?}, {query:?}: {leaks} of {} rays leak out", rays.len());
        }
    }
    Ok(())
}

fn origin_primitive_is_left_out(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::named("sphere")?;
    let leaving = |(i, t): (usize, &Triangle)| {
        let middle = (t.a + t.b + t.c) / 3.0;
        (Ray::new(middle, -middle), i as u32)
    };
    let rays: Vec<_> = fixture.triangles.iter().enumerate().map(leaving).collect();
    for query in [Query::Closest, Query::Any] {
        let launch = Session::whole(device, &fixture.scene, &rays, spec(query, Precision::Robust))?;
        for (hit, (ray, origin)) in launch.hits.iter().zip(&rays) {
            ensure!(hit.primitive != *origin, "{ray:?} hits the primitive {origin} it starts on");
            ensure!(hit.is_hit(), "{ray:?} does not reach the other side");
        }
    }
    Ok(())
}

fn limits_are_inclusive(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let hitting: Vec<(Ray, Hit)> =
        fixture.rays.iter().zip(&fixture.hits).filter(|(_, hit)| hit.is_hit()).map(|((r, _), h)| (*r, *h)).collect();
    for query in [Query::Closest, Query::Any] {
        let narrow: Vec<_> = hitting.iter().map(|(ray, hit)| (ray.with_range(hit.t, hit.t), u32::MAX)).collect();
        let launch = Session::whole(device, &fixture.scene, &narrow, spec(query, Precision::Robust))?;
        ensure!(
            launch.hits.iter().zip(&hitting).all(|(found, (_, hit))| found.t == hit.t),
            "{query:?}: tmin = tmax = t must hit at t"
        );
        let short: Vec<_> =
            hitting.iter().map(|(ray, hit)| (ray.with_range(ray.tmin, hit.t.next_down()), u32::MAX)).collect();
        let launch = Session::whole(device, &fixture.scene, &short, spec(query, Precision::Robust))?;
        let expected = short.iter().map(|(ray, origin)| brute::any(&fixture.triangles, ray, *origin));
        ensure!(
            launch.hits.iter().zip(expected).all(|(found, any)| found.is_hit() == any),
            "{query:?}: a hit beyond tmax"
        );
    }
    Ok(())
}
