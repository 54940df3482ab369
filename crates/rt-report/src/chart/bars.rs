//! A stream's activities as one row of bars per device.

use rt_balance::report::{Activity, StreamRun};

/// One activity, cut where the device was still busy with the one before it.
#[derive(Debug)]
pub(super) struct Bar<'a> {
    pub(super) activity: &'a Activity,
    /// Seconds since the balancer was made.
    pub(super) start_s: f64,
    /// Seconds since the balancer was made.
    pub(super) end_s: f64,
}

/// One row per device, each in order of time and without overlap.
///
/// With two launches in flight the second one's span begins while the first still runs, though a device works on one
/// at a time: the second is shown from where the first ends.
pub(super) fn rows(run: &StreamRun) -> Vec<Vec<Bar<'_>>> {
    let named = run.activities.iter().map(|activity| activity.device + 1).max().unwrap_or(0);
    let mut rows: Vec<Vec<Bar<'_>>> = Vec::new();
    rows.resize_with(named.max(run.report.devices.len()), Vec::new);
    for activity in &run.activities {
        if activity.start_s.is_finite() && activity.end_s.is_finite() && activity.end_s >= activity.start_s {
            let bar = Bar { activity, start_s: activity.start_s, end_s: activity.end_s };
            rows[activity.device].push(bar);
        }
    }
    for row in &mut rows {
        row.sort_by(|a, b| a.start_s.total_cmp(&b.start_s).then(a.end_s.total_cmp(&b.end_s)));
        let mut busy_until = f64::NEG_INFINITY;
        for bar in row {
            bar.start_s = bar.start_s.max(busy_until).min(bar.end_s.max(busy_until));
            bar.end_s = bar.end_s.max(bar.start_s);
            busy_until = bar.end_s;
        }
    }
    rows
}

/// When the stream began and ended, in seconds since the balancer was made.
///
/// The makespan counts from before the estimation until the last hit was on the host, so it ends with the last bar and
/// may begin before the first.
pub(super) fn extent(run: &StreamRun) -> (f64, f64) {
    let finite = || run.activities.iter().filter(|a| a.start_s.is_finite() && a.end_s.is_finite());
    let first = finite().map(|a| a.start_s).fold(f64::INFINITY, f64::min);
    let last = finite().map(|a| a.end_s).fold(f64::NEG_INFINITY, f64::max);
    let makespan = if run.report.makespan_s.is_finite() { run.report.makespan_s.max(0.0) } else { 0.0 };
    if first > last { (0.0, makespan) } else { (first.min(last - makespan), last) }
}

#[cfg(test)]
mod tests {
    use super::super::samples::{launch, run};
    use super::*;

    // Fails when `rows` keeps the activities' own starts.
    #[test]
    fn overlapping_launches_follow_each_other() {
        let run =
            run(2, vec![launch(0, 0.5, 2.0), launch(0, 0.0, 1.0), launch(1, 0.25, 0.5), launch(0, f64::NAN, 1.0)]);
        let rows = rows(&run);
        let spans = |row: &[Bar<'_>]| row.iter().map(|bar| (bar.start_s, bar.end_s)).collect::<Vec<_>>();
        assert_eq!(spans(&rows[0]), [(0.0, 1.0), (1.0, 2.0)]);
        assert_eq!(spans(&rows[1]), [(0.25, 0.5)]);
    }

    #[test]
    fn a_stream_begins_before_its_first_bar_if_its_makespan_says_so() {
        let mut run = run(1, vec![launch(0, 1.0, 3.0)]);
        run.report.makespan_s = 2.5;
        assert_eq!(extent(&run), (0.5, 3.0));
        run.report.makespan_s = 1.0;
        assert_eq!(extent(&run), (1.0, 3.0));
    }
}
