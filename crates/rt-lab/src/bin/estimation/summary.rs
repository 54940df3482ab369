//! The tables of docs/results/estimation.md: what was measured of all scenes, side by side.

use rt_balance::catalogue::{Entry, Make};
use rt_balance::stats;
use rt_lab::estimators;
use serde_json::Value;
use std::fmt::Write as _;

/// Estimators whose errors against counts are compared.
const COUNTS: [&str; 7] = ["exact 1/8", "exact 1/64", "exact 1/128", "field 1/64", "reduced 1/8", "adaptive", "auto"];
/// Those whose errors against time are.
const TIME: [&str; 5] = ["exact 1/8", "exact 1/64", "field 1/64", "reduced 1/8", "auto"];
/// Those whose overhead is.
const OVERHEAD: [&str; 9] = [
    "uniform",
    "exact 1/8",
    "exact 1/64",
    "exact 1/128",
    "field 1/64",
    "reduced 1/8",
    "reduced 1/1",
    "adaptive",
    "auto",
];

/// Repeatability below which a task's time counts as exact.
const LEAST_GOAL: f64 = 0.05;

/// How much worse than a task's own repeatability an estimate of its time may be.
const SLACK: f64 = 1.2;

/// One scene and kind of rays.
struct Measured<'a>(&'a Value);

/// The repetitions of one estimator.
struct Repetitions<'a>(Vec<&'a Value>);

impl<'a> Measured<'a> {
    fn head(&self) -> String {
        let kind = if self.0["kind"] == "primary" { "primary" } else { "diffuse" };
        format!("{} | {kind}", self.0["scene"].as_str().unwrap_or("?"))
    }

    fn of(&self, estimator: &str) -> Repetitions<'a> {
        let cases = self.0["cases"].as_array().into_iter().flatten();
        let own = cases.filter(|case| case["estimator"] == estimator);
        Repetitions(own.flat_map(|case| case["repetitions"].as_array().into_iter().flatten()).collect())
    }

    fn error(&self, of: &str) -> f64 {
        number(&self.0[of]["mean"])
    }

    /// Median seconds of a plain trace.
    fn plain(&self) -> f64 {
        let cases = self.0["cases"].as_array().into_iter().flatten();
        let all = cases.flat_map(|case| case["repetitions"].as_array().into_iter().flatten());
        median(all.map(|run| number(&run["plain"]["cpu_s"])).collect())
    }
}

impl Repetitions<'_> {
    fn values(&self, of: impl Fn(&Value) -> f64) -> Vec<f64> {
        self.0.iter().map(|run| of(run)).filter(|value| value.is_finite()).collect()
    }

    fn median(&self, of: impl Fn(&Value) -> f64) -> f64 {
        median(self.values(of))
    }

    /// The mean of one of the errors.
    fn error(&self, against: &str, which: &str) -> String {
        let values = self.values(|run| number(&run[against][which]));
        percent(values.iter().sum::<f64>() / values.len() as f64)
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn median(values: Vec<f64>) -> f64 {
    stats::median(&values)
}

fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.1}", 100.0 * share) } else { "–".to_owned() }
}

/// A heading, and a table with a row for each scene and kind of rays.
fn table(
    text: &mut String,
    title: &str,
    columns: &[&str],
    results: &[Measured<'_>],
    row: impl Fn(&Measured<'_>) -> Vec<String>,
) {
    let _ = writeln!(text, "\n### {title}\n\n| scene | rays | {} |", columns.join(" | "));
    let _ = writeln!(text, "|---|---|{}", "---|".repeat(columns.len()));
    for measured in results {
        let _ = writeln!(text, "| {} | {} |", measured.head(), row(measured).join(" | "));
    }
}

/// Every estimator of the tables, in the order of the catalogue.
pub(super) fn published() -> Vec<String> {
    let columns = || COUNTS.iter().chain(&TIME).chain(&OVERHEAD);
    let of = |entry: &Entry<Make>| {
        let mut own: Vec<String> = columns()
            .filter(|column| column.split(' ').next() == Some(entry.name))
            .map(|column| (*column).to_owned())
            .collect();
        own.sort();
        own.dedup();
        own
    };
    estimators::all().iter().flat_map(of).collect()
}

/// The tables of what was measured, as [`json`](super::table::json) has it.
pub(super) fn tables(results: &[Value]) -> String {
    let results: Vec<Measured<'_>> = results.iter().map(Measured).collect();
    let mut text = String::new();
    table(&mut text, "Errors against counts: mean (95th percentile), %", &COUNTS, &results, |m| {
        let errors = |name: &&str| {
            let own = m.of(name);
            format!("{} ({})", own.error("errors_counts", "mean"), own.error("errors_counts", "p95"))
        };
        COUNTS.iter().map(errors).collect()
    });
    let time = [&["repeats to", "goal", "exact counts", "and divergence"][..], &TIME].concat();
    table(&mut text, "Errors against time: mean (95th percentile; bias), %", &time, &results, |m| {
        let repeats = m.error("repeatability");
        let goal = LEAST_GOAL.max(SLACK * repeats);
        let [counts, divergence] =
            ["exact_counts_as_time", "exact_counts_and_divergence_as_time"].map(|of| m.error(of));
        let mut row = [repeats, goal, counts, divergence].map(percent).to_vec();
        row.extend(TIME.iter().map(|name| {
            let own = m.of(name);
            let [mean, p95, bias] = ["mean", "p95", "bias"].map(|which| own.error("errors_time", which));
            format!("{mean} ({p95}; {bias})")
        }));
        row
    });
    table(&mut text, "Net overhead: median (least – greatest), % of a plain trace", &OVERHEAD, &results, |m| {
        let net = |name: &&str| {
            let mut values = m.of(name).values(|run| number(&run["net_cpu"]));
            values.sort_by(f64::total_cmp);
            let ends = [values.first(), values.last()].map(|end| percent(end.copied().unwrap_or(f64::NAN)));
            format!("{} ({} – {})", percent(median(values)), ends[0], ends[1])
        };
        OVERHEAD.iter().map(net).collect()
    });
    let title =
        "Excess over the lower bound on 2 / 3 / 8 / 1:2:4 virtual devices, hybrid queue, estimation included, %";
    let machines: Vec<&str> = OVERHEAD.iter().copied().filter(|name| *name != "reduced 1/1").collect();
    table(&mut text, title, &machines, &results, |m| {
        let excess = |name: &&str| {
            let own = m.of(name);
            [0, 1, 2, 3].map(|machine| percent(own.median(|run| number(&run["excess"][machine])))).join(" / ")
        };
        machines.iter().map(excess).collect()
    });
    let columns =
        ["traced Mray/s", "reduced walk of all rays, % of the trace", "its error, %", "auto sampled, %", "auto used"];
    table(&mut text, "The paper's reduced walk of every ray, and what auto did", &columns, &results, |m| {
        let (reduced, auto) = (m.of("reduced 1/1"), m.of("auto"));
        let rays = number(&m.0["rays"]);
        let share = |run: &Value| number(&run["estimate"]["cpu_s"]) / number(&run["plain"]["cpu_s"]);
        let chosen = auto.0.last().and_then(|run| run["chosen"].as_str()).unwrap_or("–");
        vec![
            format!("{:.2}", rays / m.plain() / 1e6),
            percent(reduced.median(share)),
            reduced.error("errors_counts", "mean"),
            format!("{:.2}", 100.0 * auto.median(|run| number(&run["walked"])) / rays),
            chosen.to_owned(),
        ]
    });
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    /// Mutants: a column that nothing is measured for; one of the lists left out of what is measured.
    #[test]
    fn every_column_is_an_estimator_of_the_catalogue() {
        let published = published();
        for column in COUNTS.iter().chain(&TIME).chain(&OVERHEAD) {
            let name = column.split(' ').next();
            let own = estimators::all().iter().find(|entry| Some(entry.name) == name).expect(column);
            let shares = [1, 8, 64, 128].into_iter().filter_map(|n| own.with(1.0 / f64::from(n)));
            assert!(shares.chain([own.usual()]).any(|known| known.label() == *column), "{column}");
            assert!(published.iter().any(|name| name == column), "{column}");
        }
    }

    /// Mutants: columns exchanged, the greater of two middle values for a median.
    #[test]
    fn numbers_come_into_their_tables() {
        let error = r#"{"mean": 0.03, "p95": 0.08, "bias": -0.01}"#;
        let run = |net: f64| {
            format!(
                r#"{{"chosen": "field", "walked": 20, "plain": {{"cpu_s": 1e-4}}, "estimate": {{"cpu_s": 4e-5}}, "net_cpu": {net},
                    "errors_counts": {error}, "errors_time": {error}, "excess": [0.5, 0.25, 0.125, 0.0625]}}"#
            )
        };
        let case = |name: &&str| format!(r#"{{"estimator": "{name}", "repetitions": [{}, {}]}}"#, run(0.01), run(0.03));
        let cases: Vec<String> = OVERHEAD.iter().map(case).collect();
        let json = format!(
            r#"[{{"scene": "room", "kind": "primary", "rays": 1000, "repeatability": {{"mean": 0.1}},
                "exact_counts_as_time": {{"mean": 0.2}}, "exact_counts_and_divergence_as_time": {{"mean": 0.15}},
                "cases": [{}]}}]"#,
            cases.join(",")
        );
        let text = tables(&serde_json::from_str::<Vec<Value>>(&json).expect("valid"));
        let rows: Vec<&str> = text.lines().filter(|line| line.starts_with("| room | primary")).collect();
        assert_eq!(rows.len(), 5, "{text}");
        assert!(rows[0].starts_with("| room | primary | 3.0 (8.0) |"), "{}", rows[0]);
        assert!(rows[1].contains("| 10.0 | 12.0 | 20.0 | 15.0 | 3.0 (8.0; -1.0) |"), "{}", rows[1]);
        assert!(rows[2].contains("| 2.0 (1.0 – 3.0) |"), "{}", rows[2]);
        assert!(rows[3].contains("| 50.0 / 25.0 / 12.5 / 6.2 |"), "{}", rows[3]);
        assert_eq!(rows[4], "| room | primary | 10.00 | 40.0 | 3.0 | 2.00 | field |");
    }
}
