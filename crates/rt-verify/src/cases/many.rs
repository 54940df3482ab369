//! Primitive ids beyond 2²⁴, which single precision cannot tell apart, and up to the last one.

use super::built;
use crate::report::Row;
use crate::suite::{Extent, Stopped};
use crate::tally::Tally;
use crate::trial::{Refusal, Trial};
use crate::{Promise, shapes, tree};
use glam::Vec3;
use rt_bvh::{BuildOptions, Mesh};
use rt_core::{Query, Ray, Scene, SceneParts, Triangle};
use std::sync::Arc;

pub(super) const NAME: &str = "ids";

/// Cells along each side of the plane whose triangles get the ids.
const SIDE: u32 = 64;

/// First ids: around 2²⁴, and so that the last triangle has the last id there is (`u32::MAX` is a miss).
const FIRST: [u32; 3] = [(1 << 24) - 100, 3 << 24, u32::MAX - 2 * SIDE * SIDE];

/// Cells of a plane with more than 2²⁴ triangles.
const MANY: [u32; 2] = [4096, 2080];

pub(super) fn run(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    trial.advance(0.0)?;
    rows.push(renumbered(trial));
    trial.advance(0.1)?;
    rows.push(behind_others(trial));
    trial.advance(0.3)?;
    rows.push(built_for_real(trial));
    Ok(())
}

/// A ray down into the middle of half `half` of cell `[x, z]` of `side` cells.
fn down([x, z]: [u32; 2], side: [u32; 2], half: u32) -> Ray {
    // A cell is cut from its lower to its upper corner; half 0 has the larger x.
    let [dx, dz] = if half == 0 { [0.75, 0.25] } else { [0.25, 0.75] };
    Ray::new(Vec3::new((x as f32 + dx) / side[0] as f32, 1.0, (z as f32 + dz) / side[1] as f32), Vec3::NEG_Y)
}

/// A ray into every triangle of the small plane, in the order of their ids.
fn plane_rays() -> Vec<(Ray, u32)> {
    (0..2 * SIDE * SIDE).map(|id| (down([id / 2 % SIDE, id / 2 / SIDE], [SIDE; 2], id % 2), u32::MAX)).collect()
}

/// A small tree whose triangles are given large ids: what a device does with ids costs nothing to try.
fn renumbered(trial: &Trial<'_>) -> Row {
    let mut tally = Tally::new(NAME, "renumbered to 2^24 and 2^32", Promise::Agreement);
    let triangles = shapes::grid(SIDE, 0.0, 0);
    let Some(scene) = built(tree::build(&triangles, trial.options().builder), &mut tally) else { return tally.row() };
    let rays = plane_rays();
    for first in FIRST {
        let parts = SceneParts {
            nodes: scene.nodes().to_vec(),
            triangles: scene.triangles().to_vec(),
            primitives: (0..scene.primitives().len()).map(|slot| first + scene.primitives().get(slot)).collect(),
            scale_exponent: scene.scale_exponent(),
            primitive_count: first + 2 * SIDE * SIDE,
        };
        let Some(scene) = built(Scene::new(parts).map_err(|e| e.to_string()), &mut tally) else { continue };
        match trial.trace(&Arc::new(scene), &rays, Query::Closest) {
            Ok(hits) => (first..).zip(&hits).for_each(|(id, hit)| {
                tally.check(hit.primitive == id, || format!("{hit:?}, not {id}"));
            }),
            Err(refusal) => tally.refuse(&refusal, rays.len()),
        }
    }
    tally.row()
}

/// A small plane behind more than 2²⁴ triangles without area in the caller's list: what a builder does with ids.
fn behind_others(trial: &Trial<'_>) -> Row {
    let mut tally = Tally::new(NAME, "behind 2^24 triangles without area", Promise::Agreement);
    let first = (1_u32 << 24) + 5;
    let plane = shapes::grid(SIDE, 0.0, 0);
    let positions: Vec<Vec3> = plane.iter().flat_map(Triangle::vertices).collect();
    let mut indices = vec![[0_u32; 3]; first as usize];
    indices.extend((0..plane.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]));
    let mesh = Mesh { positions: &positions, indices: &indices };
    let options = BuildOptions { builder: trial.options().builder, ..BuildOptions::default() };
    let scene = rt_bvh::build(mesh, &options).map(|built| built.scene).map_err(|e| e.to_string());
    let Some(scene) = built(scene, &mut tally) else { return tally.row() };
    match trial.trace(&scene, &plane_rays(), Query::Closest) {
        Ok(hits) => (first..).zip(&hits).for_each(|(id, hit)| {
            tally.check(hit.primitive == id, || format!("{hit:?}, not {id}"));
        }),
        Err(refusal) => tally.refuse(&refusal, plane.len()),
    }
    tally.row()
}

/// A plane of more than 2²⁴ triangles, and rays into some of them all over it.
fn built_for_real(trial: &Trial<'_>) -> Row {
    let mut tally = Tally::new(NAME, "plane of 2^24 triangles", Promise::Agreement);
    if trial.options().extent != Extent::Full {
        tally.note("takes minutes and some GB: with --full");
        return tally.row();
    }
    let [columns, lines] = MANY;
    let row = columns + 1;
    let at = |i: u32| Vec3::new((i % row) as f32 / columns as f32, 0.0, (i / row) as f32 / lines as f32);
    let positions: Vec<Vec3> = (0..row * (lines + 1)).map(at).collect();
    let cell = |i: u32| {
        let a = i % columns + i / columns * row;
        [[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]
    };
    let indices: Vec<[u32; 3]> = (0..columns * lines).flat_map(cell).collect();
    let mesh = Mesh { positions: &positions, indices: &indices };
    let options = BuildOptions { builder: trial.options().builder, ..BuildOptions::default() };
    let scene = rt_bvh::build(mesh, &options).map(|built| built.scene).map_err(|e| e.to_string());
    let Some(scene) = built(scene, &mut tally) else { return tally.row() };
    let count = indices.len() as u32;
    drop((positions, indices));
    // A stride without common factor, and the last ones.
    let ids: Vec<u32> =
        (0..100_000_u32).map(|i| (u64::from(i) * 7_919 % u64::from(count)) as u32).chain(count - 1000..count).collect();
    let ray = |id: u32| (down([id / 2 % columns, id / 2 / columns], MANY, id % 2), u32::MAX);
    let rays: Vec<_> = ids.iter().map(|&id| ray(id)).collect();
    match trial.trace(&scene, &rays, Query::Closest) {
        Ok(hits) => hits.iter().zip(&ids).for_each(|(hit, id)| {
            tally.check(hit.primitive == *id, || format!("{hit:?}, not {id}"));
        }),
        Err(Refusal::OutOfMemory(reason)) => tally.note(reason),
        Err(refusal) => tally.refuse(&refusal, rays.len()),
    }
    tally.row()
}
