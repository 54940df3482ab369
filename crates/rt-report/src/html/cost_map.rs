//! A cost map of a page: estimated beside measured time of every task, read out under the pointer.

use super::{Page, escaped};
use crate::chart::cost::{CostMap, Origin, TaskCost};
use crate::chart::duration;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Colours of the scale: as many as eight bits tell apart.
const COLOURS: u32 = 256;

/// Adds the map to a page.
pub(super) fn add(page: &mut Page, map: &CostMap) {
    let [width, height] = map.size();
    let (origin, name, means, top) = (map.origin(), escaped(&map.name()), map.means(), map.top());
    // A `<` could end the script's element.
    let data = data(map, top.cost).to_string().replace('<', "\\u003c");
    let mut markup = format!("<div class=\"cost\"><h3>{name}</h3>");
    if let Some(reason) = map.why_not() {
        let _ = write!(markup, "<p>{}</p>", escaped(&reason));
    }
    if map.is_normalised() {
        markup.push_str(
            "<p>Seconds of different devices are not comparable: colours show what a device of mean speed would have \
             taken.</p>",
        );
    }
    markup.push_str("<div class=\"maps\">");
    let is_estimated = origin != Origin::Nowhere;
    let estimated = is_estimated.then_some((CostMap::name_of_estimate(origin), "estimated_ns", means.estimated));
    for (side, values, mean) in estimated.into_iter().chain([("measured", "measured_ns", means.measured)]) {
        let mean = mean.map_or_else(String::new, |ns| format!(", mean {} per ray", escaped(&duration(ns * 1e-9))));
        let _ = write!(
            markup,
            "<div><h4>{side}{mean}</h4><canvas width=\"{width}\" height=\"{height}\" data-values=\"{values}\" \
             tabindex=\"0\" role=\"img\" aria-label=\"Map of the time of every task of {name}, {side}, one task per \
             patch; arrow keys go from task to task\"></canvas></div>"
        );
    }
    let end = escaped(&duration(top.cost * 1e-9));
    let _ = write!(
        markup,
        "</div><p class=\"scale\">0 <canvas width=\"{COLOURS}\" height=\"1\" role=\"img\" \
         aria-label=\"Colour scale from 0 to {end} per ray\"></canvas> {end} per ray or more; hatched: unknown; \
         blank: no such rays</p><div class=\"readout\" aria-live=\"polite\"><dl>"
    );
    let not_used = if origin == Origin::NotUsed { " (not used)" } else { "" };
    let fields: &[(&str, &str)] = if is_estimated {
        &[
            ("task", ""),
            ("rays", ""),
            ("estimated tests", not_used),
            ("estimated time", not_used),
            ("measured time", ""),
            ("device", ""),
        ]
    } else {
        &[("task", ""), ("rays", ""), ("measured time", ""), ("device", "")]
    };
    for (name, more) in fields {
        let _ = write!(markup, "<div><dt>{name}{more}</dt><dd data-field=\"{name}\">–</dd></div>");
    }
    let _ = writeln!(markup, "</dl></div><script type=\"application/json\">{data}</script></div>");
    page.markup(&markup);
}

/// What the page's script needs; `top_ns` is the cost of the last colour in nanoseconds per ray.
fn data(map: &CostMap, top_ns: f64) -> Value {
    let [width, height] = map.size();
    let colour = |i: u32| {
        let colorous::Color { r, g, b } = colorous::VIRIDIS.eval_continuous(f64::from(i) / f64::from(COLOURS - 1));
        format!("{r:02x}{g:02x}{b:02x}")
    };
    let tasks = map.tasks();
    let list = |value: fn(&TaskCost) -> Value| tasks.iter().map(value).collect::<Vec<_>>();
    let factors = |factors: &[f64]| factors.iter().map(|&factor| short(factor)).collect::<Vec<_>>();
    json!({
        "width": width, "height": height, "top_ns": top_ns,
        "waves": map.waves().map(|(first, _)| first).collect::<Vec<_>>(),
        "factors": map.waves().map(|(_, own)| factors(own)).collect::<Vec<_>>(),
        "colours": (0..COLOURS).map(colour).collect::<String>(),
        "devices": map.devices(),
        "rows": rows(&|x, y| map.task_at(x, y), width, height),
        "tasks": {
            "rays": list(|task| json!(task.rays)),
            "kept": list(|task| json!(task.kept)),
            "tests": list(|task| task.tests.map_or(Value::Null, |(tests, _)| short(tests.into()))),
            "std_error": list(|task| task.tests.and_then(|(_, error)| error).map_or(Value::Null, |e| short(e.into()))),
            "estimated_ns": list(|task| short(task.estimated_s * 1e9)),
            "measured_ns": list(|task| short(task.measured_s * 1e9)),
            "device": list(|task| json!(task.device)),
        },
    })
}

/// The picture's rows as `[task, length, …]`, −1 where there is none; 0 for a row that is like the one above it.
fn rows(task_at: &dyn Fn(u32, u32) -> Option<u32>, width: u32, height: u32) -> Vec<Value> {
    let mut last: Vec<Option<u32>> = Vec::new();
    let row = |y| {
        let row: Vec<Option<u32>> = (0..width).map(|x| task_at(x, y)).collect();
        if row == last {
            return json!(0);
        }
        let pair = |run: &[Option<u32>]| [run[0].map_or(-1, i64::from), run.len() as i64];
        let pairs = row.chunk_by(|a, b| a == b).flat_map(pair).collect::<Vec<_>>();
        last = row;
        json!(pairs)
    };
    (0..height).map(row).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_runs_and_repeat_in_a_digit() {
        let tasks = [7, 7, 8, 7, 7, 8, u32::MAX, 8, 8];
        let at = |x: u32, y: u32| Some(tasks[(3 * y + x) as usize]).filter(|&task| task != u32::MAX);
        assert_eq!(json!(rows(&at, 3, 3)), json!([[7, 2, 8, 1], 0, [-1, 1, 8, 2]]));
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(short(123_456.0), json!(123_500));
        assert_eq!(short(0.0), json!(0));
        assert_eq!(short(f64::NAN), Value::Null);
        assert_eq!(short(0.123_456).to_string(), "0.1235");
    }
}
