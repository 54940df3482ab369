//! What the suite of promises found, for people and for programs.

use rt_report::Provenance;
use rt_report::table::{Table, grouped};
use rt_verify::{DeviceReport, Promise, Row, Verdict};
use serde::Serialize;
use std::fmt::Write;

/// What `raybalance verify --json` prints; `docs/verify.md` describes it.
#[derive(Debug, Serialize)]
pub struct Report<'a> {
    /// Version of the layout: [`SCHEMA`].
    pub schema: u32,
    /// Where it comes from.
    pub provenance: Provenance,
    /// How much was tried.
    pub extent: &'static str,
    /// What built the trees.
    pub builder: String,
    /// What was traced, beside what the suite makes itself.
    pub scenes: Vec<String>,
    /// Number and text of each promise.
    pub promises: Vec<(u8, &'static str)>,
    /// What was found on each device.
    pub devices: &'a [DeviceReport],
    /// Wall seconds of all of it.
    pub seconds: f64,
}

/// Version of the report's layout.
pub const SCHEMA: u32 = 2;

/// What was found on a device, for people.
#[must_use]
pub fn text(report: &DeviceReport) -> String {
    let mut text = format!("{} ({}), precision {}\n\n", report.device, report.backend, report.precision);
    let mut table = Table::new(&["case", "what", "promise", "tried", "failed", "ppm", "95% bounds", "verdict"]);
    for row in &report.rows {
        table.row(vec![
            row.case.to_owned(),
            row.what.clone(),
            row.promise.to_string(),
            grouped(row.trials),
            grouped(row.failures),
            ppm(row.rate),
            bounds(row),
            verdict(row),
        ]);
    }
    let _ = writeln!(text, "{table}");
    for row in report.rows.iter().filter(|row| row.verdict == Verdict::Fail) {
        let _ = writeln!(text, "  FAIL {}, {}: {}", row.case, row.what, row.note);
    }
    for promise in Promise::ALL {
        let rows: Vec<&Row> = report.rows.iter().filter(|row| row.promise == promise).collect();
        let failed = rows.iter().filter(|row| row.verdict == Verdict::Fail).count();
        let (failures, trials) = report.of(promise);
        let state = match () {
            () if failed > 0 => format!("BROKEN: {} of {} trials failed", grouped(failures), grouped(trials)),
            () if trials > 0 => format!("kept in {} trials", grouped(trials)),
            () => elsewhere(promise).to_owned(),
        };
        let _ = writeln!(text, "  promise {promise:>2}, {}: {state}", promise.text());
    }
    let [passed, failed, skipped] = [Verdict::Pass, Verdict::Fail, Verdict::Skipped].map(|v| report.count(v));
    let _ = writeln!(text, "\n  {passed} passed, {failed} failed, {skipped} skipped");
    text
}

/// Who measures what this suite does not.
const fn elsewhere(promise: Promise) -> &'static str {
    match promise {
        Promise::PriceOfRobustness => "not tried here: `raybalance tradeoff precision` measures it",
        Promise::EstimateCoverage => "not tried here: it is about estimates, not hits",
        _ => "not tried",
    }
}

fn ppm(rate: f64) -> String {
    match 1e6 * rate {
        0.0 => "0".to_owned(),
        ppm if ppm >= 100.0 => grouped(ppm.round() as u64),
        ppm => format!("{ppm:.2}"),
    }
}

fn bounds(row: &Row) -> String {
    match row.verdict {
        Verdict::Skipped => "–".to_owned(),
        _ => format!("{} – {}", ppm(row.bounds[0]), ppm(row.bounds[1])),
    }
}

fn verdict(row: &Row) -> String {
    match row.verdict {
        Verdict::Pass if row.note.is_empty() => "pass".to_owned(),
        Verdict::Pass => format!("pass: {}", row.note),
        Verdict::Fail => "FAIL".to_owned(),
        Verdict::Skipped => format!("skipped: {}", row.note),
    }
}
