//! Tables of traced streams: how each was balanced, and what each device did.

use super::{DASH, Table, grouped, percent, seconds};
use rt_balance::report::{ActivityKind, DeviceReport, StreamReport, StreamRun};
use rt_balance::stats::union;
use std::fmt::Write;

/// Why estimates were made as they were, a line for each kind of stream, frame and estimator that was chosen: of
/// several waves the longest one's reason, since they say nearly the same. Streams of estimators that have no choice
/// are left out.
#[must_use]
pub fn reasons(runs: &[StreamRun]) -> String {
    let naming = Naming::of(runs);
    let mut told: Vec<(&StreamReport, u64)> = Vec::new();
    for report in runs.iter().map(|run| &run.report).filter(|report| report.estimate.reason.is_some()) {
        let told_alike = |other: &StreamReport| {
            (&other.kind, other.frame, &other.estimate.chosen) == (&report.kind, report.frame, &report.estimate.chosen)
        };
        match told.iter_mut().find(|(other, _)| told_alike(other)) {
            Some((longest, count)) => {
                *count += 1;
                if report.makespan_s > longest.makespan_s {
                    *longest = report;
                }
            }
            None => told.push((report, 1)),
        }
    }
    let line = |(report, count): (&StreamReport, u64)| {
        let name = match count {
            1 => naming.of_stream(report),
            _ => {
                let kind = Naming { waves: false, ..naming }.of_stream(report);
                format!("{kind}, the longest of {} waves", grouped(count))
            }
        };
        let reason = report.estimate.reason.as_deref().unwrap_or_default();
        format!("  {name}: {}, since {reason}\n", report.estimate.chosen)
    };
    told.into_iter().take(MOST_ROWS).map(line).collect()
}

/// How the streams of each kind were balanced, and all of them together.
#[must_use]
pub fn stream_table(runs: &[StreamRun]) -> Table {
    let mut table = Table::new(&[
        "stream",
        "streams",
        "rays",
        "tasks",
        "Mray/s",
        "estimator",
        "estimate",
        "of trace",
        "std. error",
        "error, tests",
        "error, time",
        "makespan",
        "imbalance",
        "excess",
    ]);
    let groups = groups(runs);
    let any_several = groups.iter().any(|group| group.reports.len() > 1);
    let mut shown: Vec<&Group<'_>> = groups.iter().collect();
    shown.sort_by(|a, b| b.makespan_s().total_cmp(&a.makespan_s()));
    shown.truncate(MOST_ROWS);
    shown.sort_by_key(|group| group.place);
    for group in &shown {
        table.row(group.cells(any_several));
    }
    if groups.len() > 1 {
        let name = if shown.len() < groups.len() {
            format!("all {} (the {} longest above)", grouped(groups.len() as u64), shown.len())
        } else {
            "all".to_owned()
        };
        let all = Group { name, place: 0, reports: runs.iter().map(|run| &run.report).collect() };
        let mut cells = all.cells(any_several);
        // Errors and shares of different kinds have no common meaning.
        for column in [5, 7, 8, 9, 10, 12, 13] {
            cells[column].clear();
        }
        table.row(cells);
    }
    table.without_empty_columns()
}

/// Most rows of a table: more than that nobody reads. The longest are kept.
pub(super) const MOST_ROWS: usize = 64;

/// The streams of one kind and frame: its passes, and waves.
struct Group<'a> {
    name: String,
    /// Position among all.
    place: usize,
    reports: Vec<&'a StreamReport>,
}

fn groups(runs: &[StreamRun]) -> Vec<Group<'_>> {
    let several_frames = runs.iter().any(|run| run.report.frame > 0);
    let mut groups: Vec<Group<'_>> = Vec::new();
    for report in runs.iter().map(|run| &run.report) {
        let frame = if several_frames { format!(", frame {}", report.frame) } else { String::new() };
        let name = report.kind.clone() + &frame;
        match groups.iter_mut().find(|group| group.name == name) {
            Some(group) => group.reports.push(report),
            None => groups.push(Group { name, place: groups.len(), reports: vec![report] }),
        }
    }
    groups
}

impl Group<'_> {
    fn sum(&self, part: impl Fn(&StreamReport) -> f64) -> f64 {
        self.reports.iter().map(|report| part(report)).sum()
    }

    fn makespan_s(&self) -> f64 {
        self.sum(|report| report.makespan_s)
    }

    /// How much longer the makespans together are than what `least` says of each; `None` where it says nothing of one.
    fn beyond(&self, least: impl Fn(&StreamReport) -> Option<f64>) -> Option<f64> {
        let least = self.reports.iter().map(|report| least(report)).sum::<Option<f64>>()?;
        Some(self.makespan_s() / least - 1.0).filter(|share| share.is_finite())
    }

    /// The mean over those streams of which it is known, by their rays.
    fn mean(&self, of: impl Fn(&StreamReport) -> Option<f64>) -> Option<f64> {
        let known = self.reports.iter().filter_map(|report| Some((f64::from(report.rays), of(report)?)));
        let (rays, sum) = known.fold((0.0, 0.0), |(rays, sum), (own, value)| (rays + own, sum + own * value));
        (rays > 0.0).then(|| sum / rays)
    }

    fn cells(&self, any_several: bool) -> Vec<String> {
        let made = |report: &StreamReport| !report.estimate.is_uninformed();
        let of_made = |of: fn(&StreamReport) -> Option<f64>| self.mean(|report| of(report).filter(|_| made(report)));
        let rays = self.sum(|report| report.rays.into());
        let makespan_s = self.makespan_s();
        let estimate_s = self.sum(|report| if made(report) { report.estimate.seconds } else { 0.0 });
        let any_made = self.reports.iter().any(|report| made(report));
        let mut estimators: Vec<&str> = self.reports.iter().map(|report| &*report.estimate.chosen).collect();
        estimators.dedup();
        estimators.sort_unstable();
        estimators.dedup();
        vec![
            self.name.clone(),
            if any_several { grouped(self.reports.len() as u64) } else { DASH.to_owned() },
            grouped(rays as u64),
            grouped(self.sum(|report| report.tasks.into()) as u64),
            format!("{:.2}", rays / makespan_s.max(f64::MIN_POSITIVE) / 1e6),
            estimators.join(", "),
            if any_made { seconds(estimate_s) } else { DASH.to_owned() },
            percent(any_made.then(|| estimate_s / (makespan_s - estimate_s)).filter(|share| share.is_finite())),
            percent(self.mean(|report| report.estimate.std_error)),
            percent(of_made(|report| report.estimate.mre_counts)),
            percent(of_made(|report| report.estimate.mre_time)),
            seconds(makespan_s),
            // One device alone is never late, only idle.
            percent(self.beyond(|report| report.even_s().filter(|_| report.devices.len() > 1))),
            percent(self.beyond(|report| report.lower_bound_s)),
        ]
    }
}

/// The streams with the longest makespans, in their own order.
pub(crate) fn longest(runs: &[StreamRun], most: usize) -> Vec<&StreamRun> {
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|&a, &b| runs[b].report.makespan_s.total_cmp(&runs[a].report.makespan_s));
    order.truncate(most);
    order.sort_unstable();
    order.into_iter().map(|index| &runs[index]).collect()
}

/// What one device did over all streams.
struct Part<'a> {
    last: &'a DeviceReport,
    busy_s: f64,
    in_kernels_s: f64,
    /// Wall seconds of the launches whose tasks' own time is known, and that time; of a processor it is the thread's.
    own_s: Option<[f64; 2]>,
    launches: u64,
    tasks: u64,
    rays: u64,
    on_host: u64,
}

impl<'a> Part<'a> {
    fn of(runs: &'a [StreamRun], index: usize) -> Option<Self> {
        let parts: Vec<&DeviceReport> = runs.iter().filter_map(|run| run.report.devices.get(index)).collect();
        let last = *parts.last()?;
        let own = runs
            .iter()
            .map(|run| own_seconds(run, index))
            .fold([0.0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
        Some(Self {
            last,
            busy_s: parts.iter().map(|part| part.busy_s).sum(),
            in_kernels_s: parts.iter().map(|part| part.busy_s * part.kernel_share.unwrap_or_default()).sum(),
            own_s: (last.backend == "cpu" && own[0] > 0.0).then_some(own),
            launches: parts.iter().map(|part| u64::from(part.launches)).sum(),
            tasks: parts.iter().map(|part| u64::from(part.tasks)).sum(),
            rays: parts.iter().map(|part| part.rays).sum(),
            on_host: parts.iter().filter_map(|part| part.on_host).sum(),
        })
    }

    /// Seconds of thread time, where they are clearly fewer than those of its launches.
    fn shared_s(&self) -> Option<[f64; 2]> {
        self.own_s.filter(|[wall, own]| *own < OWN_CORE * wall)
    }
}

/// Share of its launches' time that a thread computes which has its core for itself: the rest is hand-over.
const OWN_CORE: f64 = 0.9;

/// Wall seconds of a device's launches, and the sum of the times of its tasks, where that is known of all of them.
fn own_seconds(run: &StreamRun, index: usize) -> [f64; 2] {
    let launches = run.activities.iter().filter(|a| a.device == index && a.kind == ActivityKind::Launch);
    let wall = union(launches.map(|launch| (launch.start_s, launch.end_s)).collect());
    let tasks = run.measured_s.iter().zip(&run.device_of).filter(|(_, device)| **device as usize == index);
    let own: f64 = tasks.map(|(seconds, _)| seconds).sum();
    if own.is_finite() && wall.is_finite() { [wall, own] } else { [0.0; 2] }
}

fn parts(runs: &[StreamRun]) -> Vec<Part<'_>> {
    let count = runs.first().map_or(0, |run| run.report.devices.len());
    (0..count).filter_map(|index| Part::of(runs, index)).collect()
}

/// Sums over all streams for each device, and for all of them.
#[must_use]
pub fn device_table(runs: &[StreamRun]) -> Table {
    let mut table = Table::new(&[
        "device",
        "busy",
        "thread time",
        "in kernels",
        "launches",
        "tasks",
        "rays",
        "finished on CPU",
        "model error",
    ]);
    let parts = parts(runs);
    let any_shared = parts.iter().any(|part| part.shared_s().is_some());
    let any_on_host = parts.iter().any(|part| part.on_host > 0);
    // Of a processor that is all of it.
    let any_card = parts.iter().any(|part| part.in_kernels_s < 0.9995 * part.busy_s);
    let shown = |is_shown: bool, text: String| if is_shown { text } else { DASH.to_owned() };
    for part in &parts {
        let own = part.own_s.map_or_else(|| DASH.to_owned(), |[_, own]| seconds(own));
        table.row(vec![
            part.last.name.clone(),
            seconds(part.busy_s),
            shown(any_shared, own),
            shown(any_card, percent((part.busy_s > 0.0).then(|| part.in_kernels_s / part.busy_s))),
            grouped(part.launches),
            grouped(part.tasks),
            grouped(part.rays),
            shown(any_on_host, grouped(part.on_host)),
            // What the last stream's prices leave unexplained.
            percent(part.last.model.map(|model| model.residual)),
        ]);
    }
    if parts.len() > 1 {
        table.row(vec![
            "all".to_owned(),
            seconds(parts.iter().map(|part| part.busy_s).sum()),
            String::new(),
            String::new(),
            grouped(parts.iter().map(|part| part.launches).sum()),
            grouped(parts.iter().map(|part| part.tasks).sum()),
            grouped(parts.iter().map(|part| part.rays).sum()),
            if any_on_host { grouped(parts.iter().map(|part| part.on_host).sum()) } else { String::new() },
            String::new(),
        ]);
    }
    table.without_empty_columns()
}

/// What must be said of devices beside their numbers, a sentence each: notes, failures, and cores that others used too.
#[must_use]
pub fn device_remarks(runs: &[StreamRun]) -> Vec<String> {
    let parts = parts(runs);
    let mut remarks = Vec::new();
    for part in &parts {
        let name = &part.last.name;
        remarks.extend(part.last.note.as_ref().map(|note| format!("{name}: {note}.")));
        remarks.extend(part.last.error.as_ref().map(|error| format!("{name} failed: {error}.")));
    }
    let shared: Vec<(&str, [f64; 2])> =
        parts.iter().filter_map(|part| Some((&*part.last.name, part.shared_s()?))).collect();
    let [wall, own] = [0, 1].map(|i| seconds(shared.iter().map(|(_, times)| times[i]).sum()));
    match shared[..] {
        [] => {}
        [(name, _)] => remarks.push(format!(
            "{name} shared its core with other programs: its thread computed for {own} of {wall} of launches."
        )),
        _ => remarks.push(format!(
            "{} devices shared their cores with other programs: their threads computed for {own} of {wall} of launches.",
            shared.len()
        )),
    }
    remarks
}

/// What the heads of tables mean, for whoever points at them.
#[must_use]
pub fn meaning(head: &str) -> Option<&'static str> {
    let meanings = [
        ("stream", "rays of one kind, traced together"),
        ("streams", "how many of the kind there were: passes of more and more samples, and parts that fit the memory"),
        ("rays", "how many were traced"),
        ("tasks", "parts of a stream, the unit that is dealt"),
        ("Mray/s", "million rays per second of makespan"),
        ("estimator", "what estimated the cost of tasks; uniform is the one that knows nothing"),
        ("estimate", "seconds of estimating and planning, part of the makespan"),
        ("of trace", "what the estimate added to the trace"),
        ("std. error", "what the estimate says of its own error against tests: the median over tasks"),
        ("error, tests", "mean error of the estimated tests of a task against exact counts, after one common scale"),
        ("error, time", "mean error of the predicted time of a task against that of the task traced alone"),
        ("makespan", "seconds from before the estimation until the last hit was there"),
        ("imbalance", "how much longer the stream took than if all devices had been busy to its end"),
        ("excess", "how much longer the stream took than any schedule must: over the measured lower bound"),
        ("busy", "seconds in which the device walked or traced"),
        ("thread time", "seconds that its thread computed: less than busy where other programs used its core"),
        ("in kernels", "share of its seconds that the device computed; the rest is hand-over"),
        ("launches", "how often the device was given tasks"),
        ("finished on CPU", "rays that a graphics card left to the host, since it could not be certain of them"),
        ("tree", "whether its boxes were fitted to the triangles that had moved, or it was built anew"),
        ("its cost", "what a ray is expected to pay in the fitted tree, against the tree that was built"),
        ("move", "seconds of finding out where the triangles are"),
        ("fit", "seconds of fitting the boxes, or of finding out that they cannot be"),
        ("build", "seconds of building another tree"),
        ("to devices", "seconds until all devices had the scene"),
        ("model error", "what the device's prices leave unexplained of the measured times"),
    ];
    meanings.into_iter().find(|(name, _)| *name == head).map(|(_, meaning)| meaning)
}

/// What streams are called: their kind, with frame and wave where there is more than one.
#[derive(Clone, Copy)]
struct Naming {
    frames: bool,
    waves: bool,
}

impl Naming {
    fn of(runs: &[StreamRun]) -> Self {
        Self { frames: runs.iter().any(|run| run.report.frame > 0), waves: runs.iter().any(|run| run.report.wave > 0) }
    }

    fn of_stream(&self, report: &StreamReport) -> String {
        let mut name = report.kind.clone();
        if self.frames {
            let _ = write!(name, ", frame {}", report.frame);
        }
        if self.waves {
            let _ = write!(name, ", wave {}", report.wave);
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::samples::{launch, run};

    fn traced(backend: &str, own_s: f64) -> StreamRun {
        let mut run = run(2, vec![launch(0, 0.0, 1.0), launch(1, 0.0, 1.0)]);
        run.report.devices.iter_mut().for_each(|device| backend.clone_into(&mut device.backend));
        run.device_of = vec![0, 1];
        run.measured_s = vec![own_s, 0.99];
        run
    }

    /// Mutants: columns of what was not measured, or of what is the same for all; a stream that is not in the totals.
    #[test]
    fn tables_show_what_there_is_and_its_sum() {
        let mut uninformed = traced("cpu", 0.99);
        uninformed.report.estimate.chosen = "uniform".to_owned();
        uninformed.report.devices.iter_mut().for_each(|device| device.kernel_share = Some(1.0));
        let mut other = uninformed.clone();
        other.report.kind = "shadow 0".to_owned();
        let runs = [uninformed.clone(), other.clone()];
        let streams = stream_table(&runs);
        assert_eq!(streams.rows()[0], ["stream", "rays", "tasks", "Mray/s", "estimator", "makespan", "imbalance"]);
        assert_eq!(streams.rows()[3][..3], ["all", "2,097,152", "2,048"]);
        // Streams of one kind are one row, longer than its bounds by what their sums tell.
        let passes = [
            uninformed.clone(),
            other,
            StreamRun {
                report: {
                    let mut report = uninformed.report.clone();
                    report.makespan_s = 6.0;
                    report.imbalance = Some(0.5);
                    report
                },
                ..uninformed
            },
        ];
        let table = stream_table(&passes);
        let row = &table.rows()[1];
        let excess = percent(Some(8.0 / (2.0 / 1.01 + 4.0) - 1.0));
        assert_eq!([&*row[0], &*row[1], &*row[2], &*row[7]], ["primary", "2", "2,097,152", &*excess]);
        let mut alone = runs[0].clone();
        alone.report.devices.truncate(1);
        assert!(!stream_table(&[alone]).rows()[0].contains(&"imbalance".to_owned()));
        let devices = device_table(&runs);
        assert_eq!(devices.rows()[0], ["device", "busy", "launches", "tasks", "rays"]);
        assert_eq!(devices.rows()[3], ["all", "4.00 s", "4", "4", "4,096"]);
        for head in streams.rows()[0].iter().chain(&devices.rows()[0]) {
            assert!(meaning(head).is_some() || head == "device", "{head}");
        }
    }

    /// Mutants: another kind or choice taken for the same; the first or the shortest wave told; a stream without a
    /// choice told.
    #[test]
    fn of_several_waves_the_longest_one_tells_why() {
        let of = |kind: &str, wave: u32, chosen: &str, reason: Option<&str>, makespan_s: f64| {
            let mut run = traced("cpu", 0.99);
            (run.report.kind, run.report.wave, run.report.makespan_s) = (kind.to_owned(), wave, makespan_s);
            run.report.estimate.chosen = chosen.to_owned();
            run.report.estimate.reason = reason.map(str::to_owned);
            run
        };
        let runs = [
            of("primary", 0, "uniform", Some("a"), 1.0),
            of("primary", 1, "uniform", Some("b"), 3.0),
            of("primary", 2, "uniform", Some("c"), 2.0),
            of("primary", 3, "exact", Some("d"), 2.0),
            of("shadow 0", 3, "uniform", Some("e"), 2.0),
            of("x", 4, "uniform", None, 2.0),
        ];
        let told = reasons(&runs);
        let lines: Vec<&str> = told.lines().map(str::trim).collect();
        assert_eq!(
            lines,
            [
                "primary, the longest of 3 waves: uniform, since b",
                "primary, wave 3: exact, since d",
                "shadow 0, wave 3: uniform, since e"
            ]
        );
    }

    /// Mutant: thread time of a card, which has none, or of a core that was its own.
    #[test]
    fn a_core_that_others_used_is_told() {
        assert!(device_remarks(&[traced("cpu", 0.95)]).is_empty());
        assert!(device_remarks(&[traced("vulkan", 0.5)]).is_empty());
        assert!(device_remarks(&[traced("cpu", f64::NAN)]).is_empty());
        let shared = traced("cpu", 0.5);
        let remarks = device_remarks(std::slice::from_ref(&shared));
        assert_eq!(remarks.len(), 1);
        assert!(remarks[0].ends_with("its thread computed for 500.0 ms of 1.00 s of launches."), "{remarks:?}");
        assert!(device_table(&[shared]).rows()[0].contains(&"thread time".to_owned()));
    }

    #[test]
    fn notes_and_failures_are_told_below_the_table() {
        let mut run = traced("cpu", 0.99);
        run.report.devices[0].note = Some("it was late".to_owned());
        run.report.devices[1].error = Some("unplugged".to_owned());
        let remarks = device_remarks(&[run]);
        assert_eq!(remarks, ["a <device>: it was late.", "a <device> failed: unplugged."]);
    }
}
