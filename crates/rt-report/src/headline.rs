//! One sentence about a run: how busy its devices were, and what was left to gain.

use crate::chart::cost::one_in;
use crate::table::{percent, seconds};
use rt_balance::report::{StreamReport, StreamRun};
use rt_cluster::ClusterReport;
use serde::Serialize;

/// How well a run was balanced, in one sentence and its numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Headline {
    /// All of it for people.
    pub sentence: String,
    /// Devices; of several processes, those processes.
    pub workers: usize,
    /// Wall seconds of tracing, estimates included.
    pub tracing_s: f64,
    /// Mean share of that in which a device was busy; null where nothing was traced.
    pub busy: Option<f64>,
    /// Seconds that a split by which all devices end together would have saved. By the lower bound where that was
    /// measured, else by what devices did and how fast they are.
    pub perfect_split_saves_s: f64,
    /// Wall seconds of estimates that streams were scheduled by.
    pub estimates_s: f64,
    /// What the makespans were expected to lose without those, in seconds; null where that was not known, or nothing
    /// was estimated.
    pub estimates_expected_gain_s: Option<f64>,
    /// What estimating the other streams would have cost, in seconds, less the tracing that it saves; null where nobody
    /// looked.
    pub unused_estimates_s: Option<f64>,
    /// The most that it would have gained: what a perfect split of those streams would have saved.
    pub unused_estimates_gain_at_most_s: Option<f64>,
}

/// Sums over streams.
#[derive(Default)]
struct Sums {
    tracing_s: f64,
    busy_s: f64,
    /// Seconds that all devices could have worked.
    room_s: f64,
    saves_s: f64,
    estimates_s: f64,
    expected_gain_s: Option<f64>,
    unused_s: Option<f64>,
    unused_gain_s: f64,
    /// Rays that were sampled for what was not used, and those of the streams that they were of.
    sampled: f64,
    sampled_of: f64,
    uninformed: usize,
    recalled: usize,
}

impl Headline {
    /// Of streams that one process traced.
    #[must_use]
    pub fn of(runs: &[StreamRun]) -> Self {
        let mut sums = Sums::default();
        runs.iter().for_each(|run| sums.add(&run.report));
        let workers = runs.iter().map(|run| working(&run.report)).max().unwrap_or(0);
        sums.headline(workers)
    }

    /// Of frames that several processes rendered, or rays that they traced.
    #[must_use]
    pub fn of_processes(reports: &[ClusterReport]) -> Self {
        let mut sums = Sums::default();
        for report in reports {
            let busy: f64 = report.ranks.iter().map(|rank| rank.busy_s).sum();
            let ranks = report.ranks.len().max(1) as f64;
            sums.tracing_s += report.makespan_s;
            sums.busy_s += busy;
            sums.room_s += report.makespan_s * ranks;
            sums.saves_s += (report.makespan_s - busy / ranks).max(0.0);
        }
        let workers = reports.iter().map(|report| report.ranks.len()).max().unwrap_or(0);
        let headline = sums.headline(workers);
        Self { sentence: sums.work("processes", "process", &headline), ..headline }
    }
}

/// Devices that took part to the end.
fn working(report: &StreamReport) -> usize {
    report.devices.iter().filter(|device| device.error.is_none()).count()
}

impl Sums {
    fn add(&mut self, report: &StreamReport) {
        let (makespan_s, estimate) = (report.makespan_s, &report.estimate);
        let least_s = report.lower_bound_s.or(report.even_s());
        let saves_s = least_s.map_or(0.0, |least_s| (makespan_s - least_s).max(0.0));
        self.tracing_s += makespan_s;
        self.busy_s += report.devices.iter().map(|device| device.busy_s).sum::<f64>();
        self.room_s += makespan_s * working(report) as f64;
        self.saves_s += saves_s;
        if estimate.is_uninformed() {
            self.uninformed += 1;
            self.unused_gain_s += saves_s;
            if let Some(unused) = &estimate.unused {
                // Hits of sampled rays are kept, so that they need not be traced.
                let net_s = (unused.seconds - unused.fraction * makespan_s).max(0.0);
                self.unused_s = Some(self.unused_s.unwrap_or(0.0) + net_s);
                self.sampled += unused.fraction * f64::from(report.rays);
                self.sampled_of += f64::from(report.rays);
            }
        } else {
            self.estimates_s += estimate.seconds;
            if estimate.fraction == 0.0 {
                self.recalled += 1;
            } else if estimate.uninformed_excess < 1.0 {
                let gain_s = estimate.uninformed_excess * makespan_s;
                self.expected_gain_s = Some(self.expected_gain_s.unwrap_or(0.0) + gain_s);
            }
        }
    }

    fn headline(&self, workers: usize) -> Headline {
        let busy = self.busy_s / self.room_s;
        let unused = self.unused_s.map(|_| self.unused_gain_s);
        let mut headline = Headline {
            sentence: String::new(),
            workers,
            tracing_s: self.tracing_s,
            // Rounding may take it above.
            busy: busy.is_finite().then(|| busy.min(1.0)),
            perfect_split_saves_s: if workers > 1 { self.saves_s } else { 0.0 },
            estimates_s: self.estimates_s,
            estimates_expected_gain_s: self.expected_gain_s,
            unused_estimates_s: self.unused_s,
            unused_estimates_gain_at_most_s: unused,
        };
        headline.sentence = self.work("devices", "device", &headline);
        if workers > 1 {
            for more in [self.estimated(), self.not_estimated()].into_iter().flatten() {
                headline.sentence += " ";
                headline.sentence += &more;
            }
        }
        headline
    }

    /// How busy all were.
    fn work(&self, many: &str, one: &str, headline: &Headline) -> String {
        let Headline { workers, busy, perfect_split_saves_s: saves_s, .. } = *headline;
        let Some(busy) = busy else { return "Nothing was traced.".to_owned() };
        let (busy, tracing) = (percent(Some(busy)), seconds(self.tracing_s));
        if workers < 2 {
            return format!("1 {one} was busy {busy} of {tracing} of tracing: there was nothing to balance.");
        }
        let share = percent(Some(saves_s / self.tracing_s));
        let saved = format!("a perfect split would have saved {} ({share})", seconds(saves_s));
        format!("{workers} {many} were busy {busy} of {tracing} of tracing; {saved}.")
    }

    /// What estimates took and were worth.
    fn estimated(&self) -> Option<String> {
        if self.estimates_s == 0.0 {
            return None;
        }
        let took = seconds(self.estimates_s);
        Some(match self.expected_gain_s {
            None if self.recalled > 0 => format!("Costs were those measured before, which took {took} to look up."),
            None => format!("Estimates took {took}."),
            Some(gain_s) => {
                format!("Estimates took {took}; without them a loss of {} was expected.", seconds(gain_s))
            }
        })
    }

    /// What estimates would have been worth that were not made.
    fn not_estimated(&self) -> Option<String> {
        if self.uninformed == 0 {
            return None;
        }
        let what = if self.estimates_s > 0.0 { "the other streams" } else { "costs" };
        let gain = seconds(self.unused_gain_s);
        let Some(cost_s) = self.unused_s else {
            return Some(format!("Estimating {what} first could have gained {gain} at most."));
        };
        let verdict = if cost_s < self.unused_gain_s { "it might have paid" } else { "it would not have paid" };
        let (sampled, cost) = (one_in(self.sampled / self.sampled_of), seconds(cost_s));
        Some(format!(
            "Estimating {what} first ({sampled}) would have cost about {cost} and gained {gain} at most: {verdict}."
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::samples::run;
    use rt_balance::report::UnusedReport;
    use rt_cluster::RankReport;

    /// Two devices, each busy 1 s of 2 s, and nothing known of costs.
    fn uninformed() -> StreamRun {
        let mut run = run(2, Vec::new());
        run.report.estimate.chosen = "uniform".to_owned();
        run.report.imbalance = Some(1.0);
        run
    }

    /// Mutants: the share of all makespans of one device; an estimate's cost with the tracing that it saves; a gain
    /// that is not that of the streams looked at.
    #[test]
    fn the_sentence_has_what_was_lost_and_what_estimating_would_have_cost() {
        let mut looked_at = uninformed();
        let unused = UnusedReport { fraction: 0.25, seconds: 0.75, ..UnusedReport::default() };
        looked_at.report.estimate.unused = Some(unused);
        let headline = Headline::of(&[looked_at.clone(), looked_at]);
        assert_eq!((headline.busy, headline.perfect_split_saves_s), (Some(0.5), 2.0));
        assert_eq!((headline.unused_estimates_s, headline.unused_estimates_gain_at_most_s), (Some(0.5), Some(2.0)));
        assert_eq!(
            headline.sentence,
            "2 devices were busy 50.0% of 4.00 s of tracing; a perfect split would have saved 2.00 s (50.0%). \
             Estimating costs first (1 ray in 4) would have cost about 500.0 ms and gained 2.00 s at most: it might \
             have paid."
        );
        let plain = Headline::of(&[uninformed()]).sentence;
        assert!(plain.ends_with("Estimating costs first could have gained 1.00 s at most."), "{plain}");
    }

    #[test]
    fn estimates_that_were_used_are_told_with_what_they_were_for() {
        let mut run = uninformed();
        run.report.estimate.chosen = "exact".to_owned();
        run.report.estimate.uninformed_excess = 0.3;
        let sentence = Headline::of(&[run]).sentence;
        assert!(
            sentence.ends_with("Estimates took 100.0 ms; without them a loss of 600.0 ms was expected."),
            "{sentence}"
        );
    }

    #[test]
    fn one_device_and_nothing_have_a_sentence_too() {
        let one = run(1, Vec::new());
        let sentence = Headline::of(&[one]).sentence;
        assert_eq!(sentence, "1 device was busy 50.0% of 2.00 s of tracing: there was nothing to balance.");
        assert_eq!(Headline::of(&[]).sentence, "Nothing was traced.");
    }

    #[test]
    fn processes_are_told_as_such() {
        let ranks = vec![RankReport { busy_s: 1.0, ..RankReport::default() }; 2];
        let report = ClusterReport { makespan_s: 2.0, ranks, ..ClusterReport::default() };
        let sentence = Headline::of_processes(&[report]).sentence;
        let whole =
            "2 processes were busy 50.0% of 2.00 s of tracing; a perfect split would have saved 1.00 s (50.0%).";
        assert_eq!(sentence, whole);
    }
}
