//! Who is right.

use crate::contender::Traced;
use rt_core::{Query, Ray, Triangle};
use rt_scene::Model;
use rt_verify::reference::Reference;

/// Relative difference of distances from which on they are those of different surfaces, not of different roundings.
const OTHER: f32 = 1e-3;

/// Most rays of a stream that the exact reference decides: it tests them with every triangle. Beyond, the answers of
/// this project stand for it.
const MOST: usize = 1_000;

/// Rays of a stream, spread evenly, that the exact reference decides whatever is said of them.
const SAMPLE: usize = 100;

/// Rays that share a pass of the reference over the triangles.
const TOGETHER: usize = 64;

/// The exact reference of a scene.
pub(crate) struct Judge {
    triangles: Vec<Triangle>,
}

/// What a contender said wrong.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Faults {
    /// Rays that hit something, nearer than what was found.
    pub(crate) missed: usize,
    /// Rays that do not hit what was found.
    pub(crate) phantom: usize,
}

impl Judge {
    pub(crate) fn new(model: &Model) -> Self {
        let corner = |i: u32| model.positions[i as usize];
        let triangle = |[a, b, c]: &[u32; 3]| Triangle::new(corner(*a), corner(*b), corner(*c));
        Self { triangles: model.indices.iter().map(triangle).collect() }
    }

    /// The faults of everybody; where all say the same as `ours` it is taken to be right, but for a sample.
    pub(crate) fn judge(&self, rays: &[Ray], query: Query, said: &[Vec<Traced>], ours: usize) -> Vec<Faults> {
        let mut truth = said[ours].clone();
        let in_doubt = |i: &usize| said.iter().any(|said| fault(query, said[*i], truth[*i]).is_some());
        let mut open: Vec<usize> = (0..rays.len()).filter(in_doubt).take(MOST).collect();
        open.extend((0..rays.len()).step_by((rays.len() / SAMPLE).max(1)));
        let reference = Reference::new(&self.triangles);
        for numbers in open.chunks(TOGETHER) {
            let asked: Vec<(Ray, u32)> = numbers.iter().map(|&i| (rays[i], u32::MAX)).collect();
            for (&i, verdict) in numbers.iter().zip(reference.resolve_all(&asked)) {
                truth[i] = verdict.right().map_or(Traced::Miss, |right| Traced::At(right.t));
            }
        }
        said.iter().map(|said| Faults::of(query, said, &truth)).collect()
    }
}

impl Faults {
    fn of(query: Query, said: &[Traced], truth: &[Traced]) -> Self {
        let mut faults = Self::default();
        for (&said, &truth) in said.iter().zip(truth) {
            match fault(query, said, truth) {
                Some(Fault::Missed) => faults.missed += 1,
                Some(Fault::Phantom) => faults.phantom += 1,
                None => {}
            }
        }
        faults
    }
}

enum Fault {
    Missed,
    Phantom,
}

fn fault(query: Query, said: Traced, truth: Traced) -> Option<Fault> {
    match (said, truth) {
        (Traced::Miss, Traced::Miss) => None,
        (Traced::Miss, _) => Some(Fault::Missed),
        (_, Traced::Miss) => Some(Fault::Phantom),
        (Traced::At(said), Traced::At(truth)) if query == Query::Closest => {
            let slack = OTHER * truth.abs();
            if said > truth + slack { Some(Fault::Missed) } else { (said < truth - slack).then_some(Fault::Phantom) }
        }
        _ => None,
    }
}
