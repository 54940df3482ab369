//! The estimators that are swept: those of the catalogue that take a share.

use crate::estimators;
use rt_balance::catalogue::{Entry, Make};
use rt_core::{
    Coherence, CostEstimator, CountsToken, LaunchRecord, Observation, RayStream, Step, StreamKind, StreamRecord, Walk,
};
use rt_sched::sample::{Fraction, RaySampler};

/// An estimator that takes a share, and how its rays are chosen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    entry: &'static Entry<Make>,
    sampler: Choice,
}

/// Which rays of a task are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Choice {
    /// As suits the kind of stream: strided where rays are coherent, else random.
    Own,
    /// The other way.
    Other,
}

/// The reduced traversal of the paper, in the reading that comes nearest to its price.
pub(super) const PAPERS: &str = "reduced";

/// The estimator that is also tried with the other sampler.
pub(super) const EXACT: &str = "exact";

/// All of them. `history` is none: of streams that it has not seen it knows what `exact` does.
pub(super) fn kinds() -> impl Iterator<Item = Kind> {
    let swept = estimators::all().iter().filter(|entry| entry.with(1.0).is_some() && entry.name != "history");
    swept.flat_map(|entry| {
        let other = (entry.name == EXACT).then_some(Choice::Other);
        std::iter::once(Choice::Own).chain(other).map(move |sampler| Kind { entry, sampler })
    })
}

impl Kind {
    /// What tables call it.
    pub(super) fn name(&self) -> String {
        match self.sampler {
            Choice::Own => self.entry.name.to_owned(),
            Choice::Other => format!("{}, other sampler", self.entry.name),
        }
    }

    /// Whether it is also asked to walk every ray, which gives the price of its walk: of walks that trace nothing.
    pub(super) fn every_ray(&self) -> bool {
        matches!(self.walk(), Some(Walk::Reduced(_)))
    }

    /// How it walks samples.
    pub(super) fn walk(&self) -> Option<Walk> {
        self.entry.usual().make().walk()
    }

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
        let chosen = self.entry.with(fraction.value()).unwrap_or_else(|| self.entry.usual());
        let inner = chosen.make();
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

    fn reason(&self) -> Option<String> {
        self.inner.reason()
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

    // Mutants: an estimator of the catalogue that is not swept; one that takes nothing swept.
    #[test]
    fn every_estimator_that_takes_a_share_is_swept() {
        let names: Vec<String> = kinds().map(|kind| kind.name()).collect();
        for entry in estimators::all() {
            let is_swept = !["auto", "uniform", "history"].contains(&entry.name);
            assert_eq!(names.iter().any(|name| name == entry.name), is_swept, "{}", entry.name);
        }
        assert!(names.iter().any(|name| name == PAPERS));
        assert!(kinds().all(|kind| kind.every_ray() == kind.entry.name.starts_with("reduced")));
    }

    // Mutants: `seen_as` that leaves the kind; the samplers exchanged.
    #[test]
    fn the_other_sampler_is_another() {
        let tasks = tasks_of(1024, 1024);
        // Whether there is one ray in each of the stretches of 64.
        let is_spread = |kind: &Kind, of: StreamKind| {
            let stream = RayStream { seed: 1, ..RayStream::new(of, &tasks) };
            match kind.estimator(Fraction::SIXTY_FOURTH, of).next(stream, Observation::default()) {
                Step::Sample { rays, .. } => rays.len() == 16 && (0..).zip(rays).all(|(i, ray)| ray / 64 == i),
                Step::Done(_) => false,
            }
        };
        let of_exact: Vec<Kind> = kinds().filter(|kind| kind.entry.name == EXACT).collect();
        let [own, other] = &of_exact[..] else { panic!("{of_exact:?}") };
        for (of, strided, random) in [(StreamKind::Primary, own, other), (StreamKind::Diffuse(0), other, own)] {
            assert_eq!(strided.sampler_name(of), "strided");
            assert_eq!(random.sampler_name(of), "random");
            assert!(is_spread(strided, of) && !is_spread(random, of), "{of}");
        }
    }
}
