//! What lies beside the pictures of a run in its folder.

use crate::chart::cost::{self, CostMap};
use crate::chart::{timeline, trace};
use crate::{Provenance, ReportError, exr, tasks};
use rt_balance::report::StreamRun;
use rt_cluster::Shard;
use std::path::Path;

/// Their names, and what each is; the costs in OpenEXR as well, if that is asked for.
#[must_use]
pub fn files(with_exr: bool) -> Vec<(&'static str, &'static str)> {
    let mut files = vec![
        ("cost.png", "estimated beside measured cost of each part of the picture"),
        ("timeline.svg", "what each device did when"),
        ("trace.json", "the same for Perfetto or chrome://tracing, to zoom into"),
        ("report.json", "all numbers"),
        ("tasks.csv", "the numbers of every task"),
        ("report.html", "this page"),
    ];
    if with_exr {
        files.push((COSTS_EXR, "the costs as numbers, in OpenEXR"));
    }
    files
}

/// The names of what a process writes beside its pictures. Shards write to one folder, each a report of its own: what a
/// shard knows is a part, of which charts would say little.
#[must_use]
pub fn names(with_exr: bool, shard: Option<Shard>) -> Vec<String> {
    let all = || files(with_exr).into_iter().map(|(name, _)| name.to_owned()).collect();
    shard.map_or_else(all, |_| vec![report_name(shard)])
}

/// The name of the report.
#[must_use]
pub fn report_name(shard: Option<Shard>) -> String {
    shard.map_or_else(|| "report.json".to_owned(), |shard| format!("report-{shard}.json").replace('/', "-of-"))
}

/// The costs in OpenEXR.
pub(crate) const COSTS_EXR: &str = "cost.exr";

/// Writes maps and tables, all but the reports.
///
/// # Errors
/// When a file cannot be written.
pub fn write(
    folder: &Path,
    with_exr: bool,
    costs: &[CostMap],
    runs: &[StreamRun],
    provenance: &Provenance,
) -> Result<(), ReportError> {
    let path = |name| folder.join(name);
    let (maps, tables) = rayon::join(
        || {
            cost::write_png(&path("cost.png"), costs)?;
            if with_exr { exr::write_costs(&path(COSTS_EXR), costs) } else { Ok(()) }
        },
        || {
            timeline::write_svg(&path("timeline.svg"), runs, provenance)?;
            trace::write_json(&path("trace.json"), runs, provenance)?;
            tasks::write_csv(&path("tasks.csv"), runs, provenance)
        },
    );
    maps.and(tables)
}
