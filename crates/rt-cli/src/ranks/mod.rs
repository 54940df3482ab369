//! Several processes that work together: `mpirun -np N raybalance render|trace …`.

pub(crate) mod render;
pub(crate) mod trace;

use crate::interrupt;
use anyhow::{Result, anyhow};
use rt_cluster::{ClusterError, ClusterReport, JoinError, Patience, Ranks, Relay};
use rt_report::print::note;
use rt_report::table;
use rt_report::usage::usage;

/// Joins the others, if a launcher started several.
pub(crate) fn join() -> Result<Ranks> {
    Ranks::join().map_err(|error| match error {
        JoinError::WithoutMpi { .. } => usage(error.to_string()).into(),
        error => error.into(),
    })
}

/// What carries messages; from now on the others hear that rank 0 is there.
pub(crate) fn relay(ranks: &mut Ranks) -> Result<Relay<'static>> {
    Relay::new(ranks.transport(), Patience::default(), Some(interrupt::flag())).map_err(explained)
}

/// Leaves the others. `done` says whether all are there still, or what went wrong here.
pub(crate) fn leave(ranks: Ranks, done: Result<bool>) -> Result<()> {
    let rank = ranks.rank();
    // Where something went wrong others would wait here for ever.
    ranks.leave(*done.as_ref().unwrap_or(&false));
    match done {
        Ok(_) => Ok(()),
        Err(error) => Err(error.context(format!("rank {rank} on {}", rt_cluster::host()))),
    }
}

/// What a deal ended in, as the command says it.
fn explained(error: ClusterError) -> anyhow::Error {
    match error {
        ClusterError::Cancelled => anyhow!("interrupted"),
        // The cause says it all.
        ClusterError::Job(source) if interrupt::requested() => anyhow!("interrupted: {source}"),
        error => error.into(),
    }
}

/// Tells which ranks were lost.
fn warn(report: &ClusterReport) {
    table::lost_ranks(report).for_each(|lost| note(format_args!("warning: {lost}")));
}
