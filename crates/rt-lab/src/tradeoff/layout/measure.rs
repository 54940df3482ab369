//! Both layouts of a scene, made and traced in turn.

use super::{Card, LAYOUTS};
use crate::Lab;
use crate::time_budget::TimeBudget;
use crate::tradeoff::Setting;
use crate::tradeoff::streams::{EDGES, Kind, launch, streams};
use anyhow::{Context, Result};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rt_balance::clock;
use rt_balance::stats::Summary;
use rt_bvh::{Mesh, Stack, WideTree};
use rt_core::{Hit, Precision, Query, StreamSpec, TestCounts, Tracer};
use rt_scene::prepare::Prepared;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Both layouts of one scene, on every card and with every kind of rays.
#[derive(Debug, Serialize)]
pub(super) struct SceneRows {
    pub(super) scene: String,
    pub(super) triangles: usize,
    /// Wall seconds of building the two-wide tree on all cores, one for each round.
    pub(super) build_s: Vec<f64>,
    /// Wall seconds of making the eight-wide one of it, on one core.
    pub(super) convert_s: Vec<f64>,
    pub(super) build: Summary,
    pub(super) convert: Summary,
    pub(super) rows: Vec<Row>,
}

/// One layout, card and kind of rays.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    pub(super) device: String,
    /// The device as the command line names it.
    pub(super) entry: String,
    pub(super) backend: &'static str,
    /// Kind of rays.
    pub(super) rays: &'static str,
    /// How many there are.
    pub(super) count: u32,
    pub(super) layout: &'static str,
    /// Bytes of the layout's nodes, the triangles and their ids, for each triangle.
    pub(super) bytes_per_triangle: f64,
    /// What the card holds when it traces over this layout: of the eight-wide one also the two-wide nodes, over which
    /// tests are counted.
    pub(super) held_bytes_per_triangle: f64,
    /// Box tests of a ray on average; a two-wide node has two, an eight-wide one eight, whatever is in its slots.
    pub(super) box_tests: f64,
    /// Triangle tests of a ray.
    pub(super) triangle_tests: f64,
    /// Hits that are not, bit for bit, those over the two-wide tree; of rays that any hit ends, those that are hits
    /// over one of the trees only.
    pub(super) differing: usize,
    /// Million rays per second in kernels.
    pub(super) mray_s: Summary,
    /// Million rays per second until the hits are on the host.
    pub(super) whole_mray_s: Summary,
    /// Speed in kernels over that of the two-wide tree in the same round.
    pub(super) over_two: Summary,
    /// Seconds in kernels, and until the hits are on the host, one for each round.
    pub(super) kernel_s: Vec<f64>,
    pub(super) whole_s: Vec<f64>,
    /// What the card says of how it holds the scene, such as that the eight-wide tree did not fit.
    pub(super) note: Option<String>,
}

/// A card's tracers, one for each layout.
type Tracers = [Box<dyn Tracer>; 2];

pub(super) fn measure(setting: &Setting<'_>, scene: &Path, time: &TimeBudget<'_>) -> Result<SceneRows> {
    let prepared = setting.lab.prepare(scene)?;
    let model = &prepared.model;
    let triangles: Vec<_> = (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect();
    let mut kinds = streams(&prepared, &triangles, setting.size, setting.args.seed)?;
    kinds.retain(|kind| kind.name != EDGES);
    let scene = Arc::clone(&prepared.built.scene);
    let wide = WideTree::new(&scene);
    let mut tracers = setting.cards.iter().map(|card| open(card, &scene)).collect::<Result<Vec<_>>>()?;

    let mut measured = SceneRows {
        scene: prepared.name.clone(),
        triangles: scene.triangles().len(),
        build_s: Vec::new(),
        convert_s: Vec::new(),
        build: Summary::new(&[]),
        convert: Summary::new(&[]),
        rows: Vec::new(),
    };
    for kind in &kinds {
        let tests = [None, Some(&wide)].map(|wide| tests(&prepared, wide, kind));
        for (card, tracers) in setting.cards.iter().zip(&tracers) {
            measured.rows.extend(
                (0..LAYOUTS.len())
                    .map(|layout| Row::new(card, kind, layout, tests[layout], &wide, tracers[layout].note())),
            );
        }
    }
    let time = time.clone().with_steps(measured.rows.len(), setting.repeat + 1);
    for round in time.rounds(setting.repeat) {
        let made = make(&prepared)?;
        if round > 0 {
            measured.build_s.push(made[0]);
            measured.convert_s.push(made[1]);
        }
        let mut pairs = measured.rows.chunks_exact_mut(LAYOUTS.len());
        for kind in &kinds {
            for tracers in &mut tracers {
                let Some(pair) = pairs.next() else { break };
                trace(setting.lab, pair, tracers, kind, round, prepared.precision)
                    .with_context(|| format!("{} rays on {}", kind.name, pair[0].entry))?;
                pair.iter().for_each(|_| time.step());
            }
        }
    }
    measured.summarise();
    Ok(measured)
}

fn open(card: &Card, scene: &Arc<rt_core::Scene>) -> Result<Tracers> {
    let tracer = |layout: usize| {
        let device = &card.devices[layout];
        let tracer = device.tracer(Arc::clone(scene), clock);
        tracer.with_context(|| format!("{} cannot take the {} tree", device.info().name, LAYOUTS[layout].0))
    };
    Ok([tracer(0)?, tracer(1)?])
}

/// Wall seconds of building the two-wide tree, and of making the eight-wide one of it.
fn make(prepared: &Prepared) -> Result<[f64; 2]> {
    let mesh = Mesh { positions: &prepared.model.positions, indices: &prepared.model.indices };
    let begin = Instant::now();
    let built = rt_bvh::build(mesh, &prepared.options.build())?;
    let middle = Instant::now();
    std::hint::black_box(WideTree::new(&built.scene));
    Ok([middle - begin, middle.elapsed()].map(|time| time.as_secs_f64()))
}

/// Traces one stream over both layouts, in changing order. The first round, which compiles kernels, is not counted.
fn trace(
    lab: Lab<'_>,
    pair: &mut [Row],
    tracers: &mut Tracers,
    kind: &Kind,
    round: u32,
    precision: Precision,
) -> Result<()> {
    let spec = StreamSpec::new(kind.query, precision, false);
    let mut hits = [(); 2].map(|()| Vec::new());
    for turn in 0..LAYOUTS.len() {
        lab.go_on()?;
        let layout = (turn + round as usize) % LAYOUTS.len();
        let launch = launch(tracers[layout].as_mut(), &kind.source, spec)?;
        if round > 0 {
            pair[layout].kernel_s.push(launch.span.busy().as_secs_f64());
            pair[layout].whole_s.push(launch.span.duration().as_secs_f64());
        }
        hits[layout] = launch.hits;
    }
    pair[1].differing = pair[1].differing.max(differing(kind.query, &hits));
    Ok(())
}

/// How many hits differ. Which triangle ends a ray that any hit ends depends on the order of visits, hence on the
/// layout.
fn differing(query: Query, [two, wide]: &[Vec<Hit>; 2]) -> usize {
    let bits = |hit: &Hit| match query {
        Query::Closest | Query::All { .. } => [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive],
        Query::Any => [u32::from(hit.is_hit()), 0, 0, 0],
    };
    two.len().abs_diff(wide.len()) + two.iter().zip(wide).filter(|(two, wide)| bits(two) != bits(wide)).count()
}

/// Mean box and triangle tests of a ray, counted on all cores: those of kernels, bit for bit.
fn tests(prepared: &Prepared, wide: Option<&WideTree>, kind: &Kind) -> [f64; 2] {
    /// Rays that one core counts at a time.
    const CHUNK: u32 = 1 << 12;
    let scene = &prepared.built.scene;
    let spec = StreamSpec::new(kind.query, prepared.precision, true);
    let rays = kind.source.len();
    let chunk = |chunk: u32| {
        let own = (chunk * CHUNK..rays.min((chunk + 1) * CHUNK)).map(|i| kind.source.ray(i));
        let mut sum = [0, 0];
        let sink = |_: Hit, counts: TestCounts| {
            sum = [sum[0] + u64::from(counts.boxes), sum[1] + u64::from(counts.triangles)];
        };
        let mut stack = Stack::for_scene(scene);
        match wide {
            Some(tree) => rt_bvh::trace_wide(tree, &mut stack, spec, own, sink),
            None => rt_bvh::trace(scene, &mut stack, spec, own, sink),
        }
        sum
    };
    let sums = (0..rays.div_ceil(CHUNK)).into_par_iter().map(chunk);
    let sum = sums.reduce(|| [0, 0], |a, b| [a[0] + b[0], a[1] + b[1]]);
    sum.map(|sum| sum as f64 / f64::from(rays))
}

impl Row {
    fn new(card: &Card, kind: &Kind, layout: usize, tests: [f64; 2], wide: &WideTree, note: Option<&str>) -> Self {
        let info = card.devices[layout].info();
        let two = wide.scene();
        let (all, two_nodes) = (two.bytes(), size_of_val(two.nodes()) as u64);
        let [own, held] = if layout == 0 { [all; 2] } else { [all - two_nodes + wide.bytes(), all + wide.bytes()] };
        let per_triangle = |bytes: u64| bytes as f64 / two.triangles().len().max(1) as f64;
        let unknown = Summary::new(&[]);
        Self {
            device: info.name.clone(),
            entry: card.entry.clone(),
            backend: info.backend,
            rays: kind.name,
            count: kind.source.len(),
            layout: LAYOUTS[layout].0,
            bytes_per_triangle: per_triangle(own),
            held_bytes_per_triangle: per_triangle(held),
            box_tests: tests[0],
            triangle_tests: tests[1],
            differing: 0,
            mray_s: unknown,
            whole_mray_s: unknown,
            over_two: unknown,
            kernel_s: Vec::new(),
            whole_s: Vec::new(),
            note: note.map(str::to_owned),
        }
    }
}

impl SceneRows {
    fn summarise(&mut self) {
        (self.build, self.convert) = (Summary::new(&self.build_s), Summary::new(&self.convert_s));
        for pair in self.rows.chunks_exact_mut(LAYOUTS.len()) {
            let two = pair[0].kernel_s.clone();
            for row in pair {
                let speed = |seconds: &[f64]| {
                    let speeds: Vec<f64> = seconds.iter().map(|s| f64::from(row.count) / s / 1e6).collect();
                    Summary::new(&speeds)
                };
                (row.mray_s, row.whole_mray_s) = (speed(&row.kernel_s), speed(&row.whole_s));
                row.over_two = Summary::of_ratios(&two, &row.kernel_s);
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Two rows as if measured: the eight-wide tree twice as fast in every round.
    pub(in crate::tradeoff::layout) fn rows() -> SceneRows {
        let row = |layout: usize| Row {
            device: "a card".to_owned(),
            entry: "vulkan:0".to_owned(),
            backend: "vulkan",
            rays: "diffuse",
            count: 1_000_000,
            layout: LAYOUTS[layout].0,
            bytes_per_triangle: [60.0, 45.0][layout],
            held_bytes_per_triangle: [60.0, 70.0][layout],
            box_tests: 50.0,
            triangle_tests: 5.0,
            differing: 0,
            mray_s: Summary::new(&[]),
            whole_mray_s: Summary::new(&[]),
            over_two: Summary::new(&[]),
            kernel_s: [[1.0, 2.0, 10.0], [0.5, 1.0, 5.0]][layout].to_vec(),
            whole_s: vec![2.0, 4.0, 20.0],
            note: None,
        };
        let mut rows = SceneRows {
            scene: "a \"scene\"".to_owned(),
            triangles: 1000,
            build_s: vec![0.2, 0.1, 0.3],
            convert_s: vec![0.02, 0.01, 0.03],
            build: Summary::new(&[]),
            convert: Summary::new(&[]),
            rows: vec![row(0), row(1)],
        };
        rows.summarise();
        rows
    }

    /// Mutants: the ratio upside down; ratios of medians; seconds of launches for those in kernels.
    #[test]
    fn speeds_are_compared_round_by_round() {
        let SceneRows { build, convert, rows, .. } = rows();
        assert_eq!((build.median, convert.median), (0.2, 0.02));
        assert_eq!([rows[0].mray_s.median, rows[1].mray_s.median], [0.5, 1.0]);
        assert_eq!([rows[0].over_two, rows[1].over_two].map(|s| [s.low, s.median, s.high]), [[1.0; 3], [2.0; 3]]);
        assert_eq!(rows[1].whole_mray_s.median, 0.25);
    }

    /// Mutants: any hits compared by triangle; misses compared by distance only; `abs_diff` gone.
    #[test]
    fn hits_that_differ_are_counted() {
        let hit = |t: f32, primitive| Hit { t, u: 0.25, v: 0.5, primitive };
        let two = vec![hit(1.0, 0), hit(1.0, 1), Hit::MISS, hit(2.0, 2)];
        let wide = vec![hit(1.0, 0), hit(1.0, 3), hit(1.0, 0), hit(2.0_f32.next_up(), 2)];
        let both = [two, wide];
        assert_eq!((differing(Query::Closest, &both), differing(Query::Any, &both)), (3, 1));
        assert_eq!(differing(Query::Any, &[vec![Hit::MISS; 3], Vec::new()]), 3);
    }
}
