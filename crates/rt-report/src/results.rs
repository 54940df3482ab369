//! What `raybalance render` leaves beside its pictures.

use crate::chart::cost::{self, CostMap};
use crate::chart::{timeline, trace};
use crate::{Provenance, ReportError, tasks};
use rt_balance::report::StreamRun;
use rt_cluster::Shard;
use std::path::Path;

/// The files, and what each is.
pub const FILES: [(&str, &str); 6] = [
    ("cost.png", "estimated beside measured cost of each part of the picture"),
    ("timeline.svg", "what each device did when"),
    ("trace.json", "the same for Perfetto or chrome://tracing, to zoom into"),
    ("report.json", "all numbers"),
    ("tasks.csv", "the numbers of every task"),
    ("report.html", "this page"),
];

/// The names of what a process writes. Shards write to one folder, each a report of its own; what a shard knows is a
/// part, of which charts would say little.
#[must_use]
pub fn names(shard: Option<Shard>) -> Vec<String> {
    let all = || FILES.map(|(name, _)| name.to_owned()).to_vec();
    shard.map_or_else(all, |_| vec![report_name(shard)])
}

/// The name of the report.
#[must_use]
pub fn report_name(shard: Option<Shard>) -> String {
    shard.map_or_else(|| "report.json".to_owned(), |shard| format!("report-{shard}.json").replace('/', "-of-"))
}

/// Writes what is neither `report.json` nor the page into a folder.
///
/// # Errors
/// When a file cannot be written, or there is no map.
pub fn write_charts(
    folder: &Path,
    maps: &[CostMap],
    runs: &[StreamRun],
    provenance: &Provenance,
) -> Result<(), ReportError> {
    let path = |name| folder.join(name);
    let (maps, tables) = rayon::join(
        || cost::write_png(&path("cost.png"), maps),
        || {
            timeline::write_svg(&path("timeline.svg"), runs, provenance)?;
            trace::write_json(&path("trace.json"), runs, provenance)?;
            tasks::write_csv(&path("tasks.csv"), runs, provenance)
        },
    );
    maps.and(tables)
}
