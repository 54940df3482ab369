//! The cost maps of a page: estimated beside measured time of every task, read out under the pointer.

use super::{Page, escaped};
use crate::chart::cost::{CostMap, scaled_estimate};
use crate::chart::duration;
use rt_balance::report::StreamRun;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Share of the tasks that the colours tell apart, without a unit; the most expensive ones share the last colour.
const SHOWN_SHARE: f64 = 0.995;

/// Colours of the scale: as many as eight bits tell apart.
const COLOURS: u32 = 256;

/// The primary rays of one picture.
pub(super) struct Costs<'a> {
    /// Which task is where.
    pub(super) map: &'a CostMap,
    /// One for each wave, in the order in which they were added to the map.
    pub(super) runs: Vec<&'a StreamRun>,
}

impl Costs<'_> {
    /// How many there are.
    pub(super) fn tasks(&self) -> usize {
        self.runs.iter().map(|run| run.tasks.len()).sum()
    }

    /// Adds the maps to a page.
    pub(super) fn add_to(&self, page: &mut Page) {
        let [width, height] = self.map.size();
        let (data, top_ns) = self.data();
        // A `<` could end the script's element.
        let data = data.to_string().replace('<', "\\u003c");
        let mut markup = String::from("<div class=\"cost\"><div class=\"maps\">");
        for (name, values) in [("estimated", "estimated_ns"), ("measured", "measured_ns")] {
            let _ = write!(
                markup,
                "<div><h3>{name}</h3><canvas width=\"{width}\" height=\"{height}\" data-values=\"{values}\" \
                 tabindex=\"0\" role=\"img\" aria-label=\"Map of the {name} time of every task, one task per patch; \
                 arrow keys go from task to task\"></canvas></div>"
            );
        }
        let top = escaped(&duration(top_ns * 1e-9));
        let _ = write!(
            markup,
            "</div><p class=\"scale\">0 <canvas width=\"{COLOURS}\" height=\"1\" role=\"img\" \
             aria-label=\"Colour scale from 0 to {top} per ray\"></canvas> {top} per ray or more; grey: unknown</p>\
             <div class=\"readout\" aria-live=\"polite\"><dl>"
        );
        for name in ["task", "rays", "estimated tests", "estimated time", "measured time", "device"] {
            let _ = write!(markup, "<div><dt>{name}</dt><dd data-field=\"{name}\">–</dd></div>");
        }
        let _ = writeln!(markup, "</dl></div><script type=\"application/json\">{data}</script></div>");
        page.markup(&markup);
    }

    /// What the page's script needs, and the cost of the last colour in nanoseconds per ray.
    fn data(&self) -> (Value, f64) {
        let [width, height] = self.map.size();
        let task_of: Vec<u32> = self.map.tasks().collect();
        let mut first = 0;
        let first_of = |run: &&StreamRun| {
            let own = first;
            first += run.tasks.len();
            own
        };
        let waves: Vec<usize> = self.runs.iter().map(first_of).collect();
        let runs = || self.runs.iter();
        let estimated: Vec<f64> = runs().flat_map(|run| scaled_estimate(run)).collect();
        let measured: Vec<f64> = runs().flat_map(|run| run.measured_s.iter().copied()).collect();
        let left: Vec<u32> =
            runs().flat_map(|run| run.tasks.iter().zip(&run.kept).map(|(task, kept)| task.rays - kept)).collect();
        let top_ns = top(&left, &[&estimated, &measured]);
        let colour = |i: u32| {
            let colorous::Color { r, g, b } = colorous::VIRIDIS.eval_continuous(f64::from(i) / f64::from(COLOURS - 1));
            format!("{r:02x}{g:02x}{b:02x}")
        };
        let devices = runs().next().map(|run| run.report.devices.iter().map(|d| d.name.clone()).collect::<Vec<_>>());
        let data = json!({
            "width": width, "height": height, "top_ns": top_ns, "waves": waves,
            "colours": (0..COLOURS).map(colour).collect::<String>(),
            "devices": devices.unwrap_or_default(),
            "rows": rows(&task_of, width as usize),
            "tasks": {
                "rays": runs().flat_map(|run| run.tasks.iter().map(|t| t.rays)).collect::<Vec<_>>(),
                "kept": runs().flat_map(|run| run.kept.iter().copied()).collect::<Vec<_>>(),
                "tests": runs().flat_map(|run| run.work.iter().map(|w| short(w.tests().into()))).collect::<Vec<_>>(),
                "std_error": runs()
                    .flat_map(|run| run.work.iter().map(|w| w.std_error().map(|e| short(e.into()))))
                    .collect::<Vec<_>>(),
                "estimated_ns": estimated.iter().map(|s| short(s * 1e9)).collect::<Vec<_>>(),
                "measured_ns": measured.iter().map(|s| short(s * 1e9)).collect::<Vec<_>>(),
                "device": runs().flat_map(|run| run.device_of.iter().copied()).collect::<Vec<_>>(),
            },
        });
        (data, top_ns)
    }
}

/// The picture's rows as `[task, length, …]`, −1 where there is none; 0 for a row that is like the one above it.
fn rows(task_of: &[u32], width: usize) -> Vec<Value> {
    let mut last: &[u32] = &[];
    let row = |row| {
        if row == last {
            return json!(0);
        }
        last = row;
        let runs = row.chunk_by(|a, b| a == b);
        let pair = |run: &[u32]| [i64::from(run[0].cast_signed().max(-1)), run.len() as i64];
        json!(runs.flat_map(pair).collect::<Vec<_>>())
    };
    task_of.chunks(width.max(1)).map(row).collect()
}

/// Four significant digits as a whole number or short fraction; null where unknown.
fn short(value: f64) -> Value {
    if !value.is_finite() || value == 0.0 {
        return if value == 0.0 { json!(0) } else { Value::Null };
    }
    // Multiplied and divided by the same power, so that the nearest number to the short fraction results.
    let power = 10_f64.powi(3 - value.abs().log10().floor() as i32);
    let rounded = (value * power).round() / power;
    if power <= 1.0 { json!(rounded as i64) } else { json!(rounded) }
}

/// Nanoseconds per ray that all but the most expensive tasks stay below; 1 where nothing is known.
fn top(left: &[u32], seconds: &[&[f64]]) -> f64 {
    let per_ray = |(s, &rays): (&f64, &u32)| (rays > 0 && s.is_finite()).then(|| s * 1e9 / f64::from(rays));
    let mut known: Vec<f64> = seconds.iter().flat_map(|s| s.iter().zip(left)).filter_map(per_ray).collect();
    known.sort_by(f64::total_cmp);
    let rank = ((known.len() as f64 * SHOWN_SHARE) as usize).min(known.len().saturating_sub(1));
    known.get(rank).copied().filter(|&top| top > 0.0).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_runs_and_repeat_in_a_digit() {
        let none = u32::MAX;
        let rows = rows(&[7, 7, 8, 7, 7, 8, none, 8, 8], 3);
        assert_eq!(json!(rows), json!([[7, 2, 8, 1], 0, [-1, 1, 8, 2]]));
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(short(123_456.0), json!(123_500));
        assert_eq!(short(0.0), json!(0));
        assert_eq!(short(f64::NAN), Value::Null);
        assert_eq!(short(0.123_456).to_string(), "0.1235");
    }

    #[test]
    fn an_outlier_does_not_set_the_scale() {
        let mut seconds = vec![1e-7; 1000];
        seconds[0] = 1.0;
        assert!((top(&[1; 1000], &[&seconds, &[f64::NAN; 1000]]) - 100.0).abs() < 1e-6);
        assert_eq!(top(&[0], &[&[1.0]]), 1.0);
    }
}
