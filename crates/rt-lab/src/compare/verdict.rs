//! What follows from the measurements, in sentences.

use rt_balance::stats::{Summary, median};
use serde::Serialize;

/// A way, as far as it is judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contestant<'a> {
    pub(super) label: &'a str,
    /// Queue, policy and estimator.
    pub(super) options: [&'a str; 3],
    /// Seconds of each round, of tracing and of the picture.
    pub(super) trace_s: &'a [f64],
    pub(super) picture_s: &'a [f64],
    /// Whether it has seen the rounds before.
    pub(super) later: bool,
    /// Whether it knew anything of its tasks.
    pub(super) estimated: bool,
    /// Medians; shares.
    pub(super) overhead: f64,
    pub(super) imbalance: Option<f64>,
}

/// A device alone, for `count` that are alike.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loner<'a> {
    pub(super) entry: &'a str,
    pub(super) count: usize,
    pub(super) trace_s: &'a [f64],
    pub(super) picture_s: &'a [f64],
}

/// What to use, and why.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Verdict {
    /// Which of the ways to use.
    pub(super) way: usize,
    /// Queue, policy and estimator of that.
    queue: String,
    policy: String,
    estimator: String,
    /// Whether it differs from the slowest by more than noise; null where there are too few rounds to tell.
    pub(super) larger_than_noise: Option<bool>,
    pub(super) estimate: Option<EstimateVerdict>,
    pub(super) together: Option<Together>,
    /// All of it in words.
    pub(super) sentences: Vec<String>,
}

/// What the best way with an estimate is beside the best without.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct EstimateVerdict {
    pub(super) pays: Pays,
    /// Seconds with over seconds without, round by round.
    with_over_without: Summary,
    /// What it takes, as a share of the trace.
    overhead: f64,
    /// What there is to gain: the share of the time in which devices have nothing to do without it.
    idle_without: Option<f64>,
}

/// Whether an estimate pays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Pays {
    Yes,
    No,
    /// The difference may be noise.
    Unknown,
}

/// What the devices are together beside the best of them alone.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Together {
    best: String,
    /// Seconds of that one over those of all, round by round.
    trace: Summary,
    /// The same of everything from the start of the program to the picture.
    pub(super) whole: Summary,
    /// What it would be if they did not slow each other down.
    most: f64,
}

impl Verdict {
    /// The verdict over ways of which the first is the default; `once_s` are the seconds that everything begins with.
    pub(super) fn new(ways: &[Contestant<'_>], noise: Option<f64>, alone: &[Loner<'_>], once_s: f64) -> Self {
        let (way, advice, larger_than_noise) = advise(ways, noise);
        let estimate = estimate(ways, noise);
        let together = Together::new(&ways[way], alone, once_s);
        let sentences = [
            Some(advice),
            later(ways, noise),
            estimate.as_ref().map(|(verdict, labels)| verdict.sentence(*labels, noise)),
            together.as_ref().map(|together| together.sentence(alone)),
        ];
        let [queue, policy, estimator] = ways[way].options.map(str::to_owned);
        Self {
            way,
            queue,
            policy,
            estimator,
            larger_than_noise,
            estimate: estimate.map(|(verdict, _)| verdict),
            together,
            sentences: sentences.into_iter().flatten().collect(),
        }
    }
}

fn seconds(way: &Contestant<'_>) -> f64 {
    median(way.trace_s)
}

/// The fastest by its median.
fn fastest<'a>(ways: impl Iterator<Item = (usize, &'a Contestant<'a>)>) -> Option<(usize, &'a Contestant<'a>)> {
    ways.min_by(|(_, a), (_, b)| seconds(a).total_cmp(&seconds(b)))
}

/// Which way to use for a first picture: the default, unless another is surely faster; and whether any differs from it.
fn advise(ways: &[Contestant<'_>], noise: Option<f64>) -> (usize, String, Option<bool>) {
    let default = &ways[0];
    let first = || ways.iter().enumerate().filter(|(_, way)| !way.later);
    let others = first().count() - 1;
    if others == 0 {
        return (0, format!("Only the default ({}) was measured.", default.label), None);
    }
    let Some(noise) = noise else {
        let rounds = default.trace_s.len();
        let plural = if rounds == 1 { "" } else { "s" };
        let text =
            format!("{rounds} round{plural} are too few to tell the ways apart: give --repeat 7, or more budget.");
        return (0, text.replace("1 round are", "1 round is"), None);
    };
    let over = |way: &Contestant<'_>| Summary::of_ratios(way.trace_s, default.trace_s);
    let differs = |way: &Contestant<'_>| over(way).differs_by_more_than(noise);
    let slower: Vec<String> = first()
        .filter(|(_, way)| differs(way) && over(way).median > 1.0)
        .map(|(_, way)| format!("{} (+{})", way.label, percent(over(way).median - 1.0)))
        .collect();
    let faster = fastest(first().filter(|(_, way)| differs(way) && over(way).median < 1.0));
    if let Some((index, way)) = faster {
        let Summary { median, low, high, .. } = over(way);
        let text = format!(
            "Use {}: it takes {} less time than the default [{} to {}], which is more than the noise of {}.",
            way.label,
            percent(1.0 - median),
            percent(1.0 - high),
            percent(1.0 - low),
            percent(noise)
        );
        return (index, text, Some(true));
    }
    let text = if slower.is_empty() {
        format!(
            "Use the default ({}): the differences between the ways are not larger than the noise of {}.",
            default.label,
            percent(noise)
        )
    } else {
        format!(
            "Use the default ({}): nothing is faster by more than the noise of {}. Slower by more are {}.",
            default.label,
            percent(noise),
            listed(&slower)
        )
    };
    (0, text, Some(!slower.is_empty()))
}

/// What changes in later frames, of which the estimator has seen the ones before.
fn later(ways: &[Contestant<'_>], noise: Option<f64>) -> Option<String> {
    let (_, way) = fastest(ways.iter().enumerate().filter(|(_, way)| way.later))?;
    let ratio = Summary::of_ratios(way.trace_s, ways[0].trace_s);
    let change = percent((ratio.median - 1.0).abs());
    Some(match ratio.differs_by_more_than(noise?) {
        true if ratio.median < 1.0 => format!("In later frames of an animation {} takes {change} less.", way.label),
        true => format!("In later frames of an animation {} takes {change} more.", way.label),
        false => return None,
    })
}

/// The best way that estimates beside the best that does not, both for a first picture, and what they are called.
fn estimate<'a>(ways: &'a [Contestant<'a>], noise: Option<f64>) -> Option<(EstimateVerdict, [&'a str; 2])> {
    let best = |estimated| fastest(ways.iter().enumerate().filter(move |(_, w)| !w.later && w.estimated == estimated));
    let ((_, with), (_, without)) = (best(true)?, best(false)?);
    let ratio = Summary::of_ratios(with.trace_s, without.trace_s);
    let pays = match noise.is_some_and(|noise| ratio.differs_by_more_than(noise)) {
        true if ratio.median < 1.0 => Pays::Yes,
        true => Pays::No,
        false => Pays::Unknown,
    };
    let idle_without = without.imbalance.map(|imbalance| imbalance / (1.0 + imbalance));
    let verdict = EstimateVerdict { pays, with_over_without: ratio, overhead: with.overhead, idle_without };
    Some((verdict, [with.label, without.label]))
}

impl EstimateVerdict {
    fn sentence(&self, [with, without]: [&str; 2], noise: Option<f64>) -> String {
        let change = percent((self.with_over_without.median - 1.0).abs());
        let cost = format!("estimating takes {} of the trace", percent(self.overhead));
        let gain = match self.idle_without {
            Some(idle) => {
                format!("{without}, which estimates nothing, leaves devices idle for {} of the time", percent(idle))
            }
            None => format!("{without} estimates nothing"),
        };
        match self.pays {
            Pays::Yes => format!("An estimate pays here: {with} takes {change} less, since {gain}, and {cost}."),
            Pays::No => {
                format!("An estimate does not pay here: {with} takes {change} longer, since {cost}, and {gain}.")
            }
            Pays::Unknown => {
                let why = if noise.is_some() { "from the noise" } else { "from so few rounds" };
                format!("Whether an estimate pays cannot be told {why}: {cost} ({with}); {gain}.")
            }
        }
    }
}

impl Together {
    fn new(way: &Contestant<'_>, alone: &[Loner<'_>], once_s: f64) -> Option<Self> {
        let trace = |loner: &Loner<'_>| median(loner.trace_s);
        let best = alone.iter().min_by(|a, b| trace(a).total_cmp(&trace(b)))?;
        let whole = |picture_s: &[f64]| picture_s.iter().map(|seconds| once_s + seconds).collect::<Vec<f64>>();
        Some(Self {
            best: best.entry.to_owned(),
            trace: Summary::of_ratios(best.trace_s, way.trace_s),
            whole: Summary::of_ratios(&whole(best.picture_s), &whole(way.picture_s)),
            most: alone.iter().map(|loner| loner.count as f64 * trace(best) / trace(loner)).sum(),
        })
    }

    fn sentence(&self, alone: &[Loner<'_>]) -> String {
        let Self { best, trace, whole, most } = self;
        let count: usize = alone.iter().map(|loner| loner.count).sum();
        let best = if alone.len() == 1 { "one of them".to_owned() } else { format!("the best one alone ({best})") };
        let times = |ratio: &Summary| match ratio.interval() {
            Some([low, high]) => format!("{:.2} times [{low:.2} to {high:.2}]", ratio.median),
            None => format!("{:.2} times", ratio.median),
        };
        format!(
            "These {count} devices together are {} as fast as {best} at tracing, of at most {most:.2} if none slowed \
             another down, and {} of the whole, loading, building and shading included.",
            times(trace),
            times(whole)
        )
    }
}

/// The first three, and how many more.
fn listed(names: &[String]) -> String {
    const MOST: usize = 3;
    match names {
        [only] => only.clone(),
        [all @ .., last] if names.len() <= MOST => format!("{} and {last}", all.join(", ")),
        _ => format!("{} and {} more", names[..MOST].join(", "), names.len() - MOST),
    }
}

/// A share as people read it.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent.abs() < 9.95 { format!("{percent:.1}%") } else { format!("{percent:.0}%") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_balance::stats;

    /// Seconds of a way that takes `base`, in rounds with noise of some percent, drift, and now and then a disturbance.
    fn times(seed: u32, way: u32, rounds: u32, base: f64, noise: f64) -> Vec<f64> {
        let pair = |i, j| rt_core::random::pair(seed, i, j).map(f64::from);
        let time = |round| {
            let ([a, b], [c, d]) = (pair(way, 2 * round), pair(way, 2 * round + 1));
            let [drift, _] = pair(1_000, round);
            base * (noise * 1.7 * (a + b + c + d - 2.0) + 0.1 * drift).exp()
        };
        (0..rounds).map(time).collect()
    }

    /// Ways of which each takes so much; the first is the default, `estimated` says which know costs.
    fn judged(seed: u32, rounds: u32, bases: &[f64], estimated: &[bool], noise: f64) -> Verdict {
        let all: Vec<Vec<f64>> = (0..).zip(bases).map(|(way, &base)| times(seed, way, rounds, base, noise)).collect();
        let rows: Vec<&[f64]> = all.iter().map(Vec::as_slice).collect();
        let names = ["default", "one", "two", "three", "four", "five"];
        let ways: Vec<Contestant<'_>> = (all.iter().zip(estimated).zip(names))
            .map(|((trace_s, &estimated), label)| Contestant {
                label,
                options: [label, "lpt", "auto"],
                trace_s,
                picture_s: trace_s,
                later: false,
                estimated,
                overhead: if estimated { 0.02 } else { 0.0 },
                imbalance: Some(if estimated { 0.001 } else { 0.004 }),
            })
            .collect();
        let slow = times(seed, 500, rounds, 2.0 * bases[0], noise);
        let slower = times(seed, 501, rounds, 4.0 * bases[0], noise);
        let alone = [("cpu:1", 2, &slow), ("cpu:1@0.5", 1, &slower)].map(|(entry, count, seconds)| Loner {
            entry,
            count,
            trace_s: seconds,
            picture_s: seconds,
        });
        Verdict::new(&ways, stats::noise(&rows), &alone, bases[0])
    }

    const BLIND: [bool; 6] = [false; 6];

    /// Mutants: the fastest by its median advised, whatever the noise; `larger_than_noise` of the smallest difference.
    #[test]
    fn what_is_alike_keeps_the_default_and_the_noise_is_named() {
        let kept = (0..200).filter(|&seed| {
            let verdict = judged(seed, 7, &[1.0; 6], &BLIND, 0.02);
            verdict.way == 0 && verdict.larger_than_noise == Some(false)
        });
        assert!(kept.count() >= 190);
        let text = &judged(1, 7, &[1.0; 6], &BLIND, 0.02).sentences[0];
        assert!(
            text.starts_with("Use the default (default)") && text.contains("not larger than the noise of "),
            "{text}"
        );
    }

    /// Mutants: the slowest advised; the second fastest; a difference told in the wrong direction.
    #[test]
    fn what_is_surely_faster_is_advised() {
        for seed in 0..50 {
            let verdict = judged(seed, 9, &[1.0, 1.02, 0.8, 0.9, 1.3, 1.0], &BLIND, 0.01);
            assert_eq!((verdict.way, verdict.larger_than_noise), (2, Some(true)), "{verdict:?}");
            let text = &verdict.sentences[0];
            assert!(text.starts_with("Use two: it takes ") && text.contains("less time than the default"), "{text}");
            let slow = judged(seed, 9, &[1.0, 1.3, 1.0, 1.0, 1.4, 1.5], &BLIND, 0.01);
            assert_eq!((slow.way, slow.larger_than_noise), (0, Some(true)));
            assert!(slow.sentences[0].contains("Slower by more are one (+"), "{}", slow.sentences[0]);
        }
    }

    /// Mutants: with and without exchanged; noise taken for a win.
    #[test]
    fn an_estimate_pays_where_the_best_with_one_is_surely_faster() {
        let pays = |bases: &[f64], seed| judged(seed, 9, bases, &[false, true, false, true, false, false], 0.01);
        for seed in 0..50 {
            let verdict = pays(&[1.0, 0.8, 1.1, 1.2, 1.0, 1.0], seed);
            assert_eq!(verdict.estimate.unwrap().pays, Pays::Yes);
            assert!(
                verdict.sentences.iter().any(|s| s.starts_with("An estimate pays here: one takes ")),
                "{verdict:?}"
            );
            let verdict = pays(&[1.0, 1.3, 1.1, 1.2, 1.0, 1.0], seed);
            assert_eq!(verdict.estimate.unwrap().pays, Pays::No);
            let why = "takes 2.0% of the trace, and default, which estimates nothing, leaves devices idle for 0.4%";
            let said =
                verdict.sentences.iter().any(|sentence| sentence.contains("does not pay") && sentence.contains(why));
            assert!(said || verdict.way != 0 || !verdict.sentences[1].contains("default"), "{verdict:?}");
        }
        let unknown = (0..100).filter(|&seed| pays(&[1.0; 6], seed).estimate.unwrap().pays == Pays::Unknown).count();
        assert!(unknown >= 95, "{unknown}");
        assert!(judged(1, 9, &[1.0; 6], &BLIND, 0.01).estimate.is_none());
    }

    /// Mutants: the slower of the devices as the best; what all begin with left out, or counted once; `most` without
    /// the count.
    #[test]
    fn together_is_set_beside_the_best_alone() {
        let together = judged(3, 9, &[1.0; 3], &[false; 3], 0.001).together.unwrap();
        assert_eq!(together.best, "cpu:1");
        let near = |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 0.02, "{found}, not {wanted}");
        near(together.trace.median, 2.0);
        near(together.whole.median, 1.5);
        near(together.most, 2.5);
    }

    /// Mutants: a verdict of one round; an interval of one, or noise that was not measured, in its words.
    #[test]
    fn too_few_rounds_and_too_few_ways_are_said() {
        let verdict = judged(1, 1, &[1.0, 2.0], &[false; 2], 0.01);
        assert_eq!((verdict.way, verdict.larger_than_noise), (0, None));
        assert!(verdict.sentences[0].starts_with("1 round is too few"), "{verdict:?}");
        let once = judged(1, 1, &[1.0, 2.0], &[false, true], 0.01).sentences.concat();
        assert!(once.contains("cannot be told from so few rounds") && !once.contains(['[', ']']), "{once}");
        assert!(judged(1, 9, &[1.0], &[false], 0.01).sentences[0].starts_with("Only the default"));
    }

    #[test]
    fn names_are_listed_and_shares_are_short() {
        let names = ["a", "b", "c", "d", "e"].map(str::to_owned);
        assert_eq!(listed(&names[..1]), "a");
        assert_eq!(listed(&names[..3]), "a, b and c");
        assert_eq!(listed(&names), "a, b, c and 2 more");
        assert_eq!((percent(0.0123), percent(0.123)), ("1.2%".to_owned(), "12%".to_owned()));
    }
}
