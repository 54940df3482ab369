//! The estimators that are swept.

use rt_core::{
    Coherence, CostEstimator, CountsToken, LaunchRecord, Observation, RayStream, ReducedWalk, Step, StreamKind,
    StreamRecord, Walk,
};
use rt_sched::estimate::{Adaptive, Auto, Field, Sampled};
use rt_sched::sample::{Fraction, RaySampler};

/// An estimator that takes a fraction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) make: fn(Fraction) -> Box<dyn CostEstimator>,
    /// How its rays are chosen.
    pub(super) sampler: Choice,
    /// Whether it is also asked to walk every ray, which gives the price of its walk.
    pub(super) every_ray: bool,
}

/// Which rays of a task are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Choice {
    /// As suits the kind of stream: strided where rays are coherent, else random.
    Own,
    /// The other way.
    Other,
}

fn exact(fraction: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Sampled::new(Walk::Full, fraction))
}

fn leaf(fraction: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Sampled::new(Walk::Reduced(ReducedWalk::LeafAsHit), fraction))
}

fn unshortened(fraction: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Sampled::new(Walk::Reduced(ReducedWalk::Unshortened), fraction))
}

fn plane(fraction: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Sampled::new(Walk::Reduced(ReducedWalk::LeafPlane), fraction))
}

fn truncated(fraction: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Sampled::new(Walk::Reduced(ReducedWalk::Truncated), fraction))
}

fn field(fraction: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Field::new(fraction))
}

fn adaptive(fraction: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Adaptive::new(fraction))
}

/// Its budget is a share of the trace, not of the rays.
fn auto(budget: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Auto::new(budget.value()))
}

/// The reduced traversal of the paper, in the reading that comes nearest to its price.
pub(super) const PAPERS: &str = "reduced, leaf as hit";

/// All of them.
pub(super) const KINDS: [Kind; 9] = [
    Kind { name: "exact", make: exact, sampler: Choice::Own, every_ray: false },
    Kind { name: "exact, other sampler", make: exact, sampler: Choice::Other, every_ray: false },
    Kind { name: PAPERS, make: leaf, sampler: Choice::Own, every_ray: true },
    Kind { name: "reduced, unshortened", make: unshortened, sampler: Choice::Own, every_ray: true },
    Kind { name: "reduced, leaf plane", make: plane, sampler: Choice::Own, every_ray: true },
    Kind { name: "reduced, truncated tree", make: truncated, sampler: Choice::Own, every_ray: true },
    Kind { name: "cost field", make: field, sampler: Choice::Own, every_ray: false },
    Kind { name: "adaptive from", make: adaptive, sampler: Choice::Own, every_ray: false },
    Kind { name: "auto, budget", make: auto, sampler: Choice::Own, every_ray: false },
];

impl Kind {
    /// The sampler's name for a kind of stream.
    pub(super) fn sampler_name(&self, kind: StreamKind) -> &'static str {
        match self.sampler(kind) {
            RaySampler::Strided => "strided",
            RaySampler::Random => "random",
        }
    }

    fn sampler(&self, kind: StreamKind) -> RaySampler {
        match (RaySampler::for_kind(kind), self.sampler) {
            (own, Choice::Own) => own,
            (RaySampler::Strided, Choice::Other) => RaySampler::Random,
            (RaySampler::Random, Choice::Other) => RaySampler::Strided,
        }
    }

    /// The estimator for streams of a kind.
    pub(super) fn estimator(&self, fraction: Fraction, kind: StreamKind) -> Box<dyn CostEstimator> {
        let inner = (self.make)(fraction);
        match self.sampler {
            Choice::Own => inner,
            Choice::Other => Box::new(SampledAs { inner, sampler: self.sampler(kind) }),
        }
    }
}

/// An estimator that is told another kind of stream, by which it chooses its sampler.
#[derive(Debug)]
struct SampledAs {
    inner: Box<dyn CostEstimator>,
    sampler: RaySampler,
}

impl SampledAs {
    fn seen_as<'a>(&self, stream: RayStream<'a>) -> RayStream<'a> {
        let kind = match self.sampler {
            RaySampler::Strided => StreamKind::Primary,
            RaySampler::Random => StreamKind::Custom,
        };
        RayStream { kind, coherence: Coherence::Unknown, ..stream }
    }
}

impl CostEstimator for SampledAs {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn chosen(&self) -> &'static str {
        self.inner.chosen()
    }

    fn counts(&self) -> CountsToken {
        self.inner.counts()
    }

    fn walk(&self) -> Option<Walk> {
        self.inner.walk()
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        self.inner.next(self.seen_as(stream), seen)
    }

    fn counts_tests(&self) -> bool {
        self.inner.counts_tests()
    }

    fn learn(&mut self, launch: &LaunchRecord<'_>) {
        self.inner.learn(&LaunchRecord { stream: self.seen_as(launch.stream), ..*launch });
    }

    fn finish(&mut self, record: &StreamRecord<'_>) {
        self.inner.finish(&StreamRecord { stream: self.seen_as(record.stream), ..*record });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::tasks_of;

    // Mutants: `seen_as` that leaves the kind; the samplers exchanged.
    #[test]
    fn the_other_sampler_is_another() {
        let tasks = tasks_of(1024, 1024);
        // Whether there is one ray in each of the stretches of 64.
        let is_spread = |kind: &Kind, of: StreamKind| {
            let stream = RayStream {
                kind: of,
                coherence: Coherence::Unknown,
                tasks: &tasks,
                seed: 1,
                wave: 0,
                source: None,
                devices: 1,
                uninformed_excess: 1.0,
            };
            match kind.estimator(Fraction::SIXTY_FOURTH, of).next(stream, Observation::default()) {
                Step::Sample { rays, .. } => rays.len() == 16 && (0..).zip(rays).all(|(i, ray)| ray / 64 == i),
                Step::Done(_) => false,
            }
        };
        let [own, other] = [&KINDS[0], &KINDS[1]];
        for (of, strided, random) in [(StreamKind::Primary, own, other), (StreamKind::Diffuse(0), other, own)] {
            assert_eq!(strided.sampler_name(of), "strided");
            assert_eq!(random.sampler_name(of), "random");
            assert!(is_spread(strided, of) && !is_spread(random, of), "{of}");
        }
    }
}
