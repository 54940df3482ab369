//! The rays that are measured: from the camera, to the sun, bounced, and anywhere.

use anyhow::{Context, Result};
use glam::Vec3;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rt_core::bounce::Departure;
use rt_core::{BounceRays, Hit, Query, Ray, RaySource, Scene, StreamSpec, random};
use rt_scene::View;
use rt_scene::prepare::Prepared;
use rt_scene::streams::{self, Paths, Wave};
use std::f32::consts::TAU;
use std::sync::Arc;

/// Rays of one kind.
#[derive(Debug)]
pub(crate) struct Rays {
    pub(crate) kind: &'static str,
    pub(crate) query: Query,
    pub(crate) source: RaySource,
}

/// A scene with a view of it.
#[derive(Debug)]
pub(crate) struct BenchScene<'a> {
    prepared: &'a Prepared,
    pub(crate) tree: Arc<Scene>,
    view: View,
}

/// Rounds of bounces that are made at most to have as many rays as asked for: a camera that sees little but sky.
const MOST_ROUNDS: u32 = 64;

impl<'a> BenchScene<'a> {
    /// Seen as `render` shows it.
    pub(crate) fn new(prepared: &'a Prepared) -> Self {
        Self { prepared, tree: Arc::clone(&prepared.built.scene), view: prepared.view() }
    }

    /// `rays` rays of each kind: primary ones fill a square picture, rounded up to whole rows. Kinds that the scene has
    /// none of are left out.
    pub(crate) fn streams(&self, rays: u32, seed: u32) -> Result<Vec<Rays>> {
        let side = f64::from(rays).sqrt().ceil() as u32;
        let size = [side, side];
        let paths = self.prepared.paths(&self.view, size, seed);
        let paths = paths.with_context(|| format!("the camera of {}", self.prepared.model.source))?;
        let wave = Wave::whole(size)?;
        let primary = paths.primary(&wave).source;
        let count = primary.len();
        let hits = streams::trace(&self.tree, &primary, StreamSpec::default());
        let [shadow, diffuse] = filled(&paths, &wave, &hits, count);
        let random = RaySource::Explicit { rays: self.random(count, seed), origins: None };
        let all = [
            Rays { kind: "primary", query: Query::Closest, source: primary },
            Rays { kind: "shadow", query: Query::Any, source: shadow },
            Rays { kind: "diffuse", query: Query::Closest, source: diffuse },
            Rays { kind: "random", query: Query::Closest, source: random },
        ];
        Ok(all.into_iter().filter(|rays| !rays.source.is_empty()).collect())
    }

    /// From anywhere in the scene's box in any direction: nothing that neighbours have in common.
    fn random(&self, count: u32, seed: u32) -> Arc<[Ray]> {
        let bounds = self.prepared.model.bounds();
        let ray = |index| {
            let origin = bounds.min + bounds.extent() * Vec3::from(random::pcg3d([seed, index, 0]).map(random::unit));
            let [height, turn] = random::pair(seed, index, 1);
            let z = 1.0 - 2.0 * height;
            let (sin, cos) = (TAU * turn).sin_cos();
            let r = (1.0 - z * z).max(0.0).sqrt();
            Ray::new(origin, Vec3::new(r * cos, r * sin, z))
        };
        (0..count).into_par_iter().map(ray).collect::<Vec<_>>().into()
    }
}

/// `count` shadow and as many diffuse rays, from round after round off all hits, each with other random numbers: those
/// of the pixels that would come next in a larger picture.
fn filled(paths: &Paths, wave: &Wave, hits: &[Hit], count: u32) -> [RaySource; 2] {
    let follow = |first: u32| paths.follow(&paths.primary(&Wave { first, ..wave.clone() }), hits);
    let streams = follow(0);
    let mut lists = streams.each_ref().map(|stream| stream.departures().to_vec());
    for round in 1..MOST_ROUNDS {
        if lists.iter().all(|list| list.is_empty() || list.len() >= count as usize) {
            break;
        }
        let first = round.wrapping_mul(count);
        let place = |from: &Departure| Departure { path: from.path.wrapping_add(first), ..*from };
        for (list, stream) in lists.iter_mut().zip(follow(first)) {
            list.extend(stream.departures().iter().map(place));
        }
    }
    std::array::from_fn(|kind| {
        let source = &streams[kind].source;
        let RaySource::Bounce(rays) = source else { return source.clone() };
        let departures = lists[kind].iter().copied().take(count as usize).collect();
        RaySource::Bounce(Arc::new(BounceRays { departures, ..(**rays).clone() }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_bvh::Builder;
    use rt_scene::prepare::{Options, prepare};

    /// Fails when spawning stops after one round: a third of the car's picture is floor and sky.
    #[test]
    fn every_kind_has_as_many_rays_as_asked_for() {
        let path = std::path::Path::new("car");
        let prepared = prepare(path, &Options::new(Builder::default()), &mut rt_scene::obj::unwatched).unwrap();
        let scene = BenchScene::new(&prepared);
        let rays = scene.streams(1000, 1).unwrap();
        assert_eq!(rays.iter().map(|rays| rays.kind).collect::<Vec<_>>(), ["primary", "shadow", "diffuse", "random"]);
        // 32 × 32 pixels.
        assert!(rays.iter().all(|rays| rays.source.len() == 1024));
        let hits = streams::trace(&scene.tree, &rays[3].source, StreamSpec::default());
        assert!(hits.len() == 1024 && hits.iter().any(rt_core::Hit::is_hit));
    }
}
