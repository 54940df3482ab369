//! Several processes that work together: `mpirun -np N raybalance render|trace …`.

pub(crate) mod render;
pub(crate) mod trace;

use crate::{interrupt, memory};
use anyhow::{Context, Result, anyhow};
use rt_cluster::{ClusterError, ClusterReport, RankReport, Transport, local};
use rt_report::print::{Stdout, note};
use rt_report::table::{Table, seconds};
use std::io::Write;

/// The processes that work together: one, unless a launcher started several.
pub(crate) struct Ranks {
    #[cfg(feature = "mpi")]
    world: Option<rt_cluster::mpi::World>,
}

/// What launchers say of the number of processes.
const LAUNCHERS: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"];

impl Ranks {
    /// Joins the others, if a launcher started several.
    pub(crate) fn join() -> Result<Self> {
        let launched = LAUNCHERS.into_iter().find(|name| std::env::var_os(name).is_some());
        #[cfg(feature = "mpi")]
        return Ok(Self { world: launched.map(|_| rt_cluster::mpi::World::join()).transpose()? });
        #[cfg(not(feature = "mpi"))]
        match launched {
            // Each of them would do all the work, and write over the others' results.
            Some(name) if std::env::var(name).is_ok_and(|size| size != "1") => {
                let what = "an MPI launcher started several of these, but this program was built without MPI";
                Err(rt_report::usage::usage(format!("{what} ({name} is set): build it with --features mpi")).into())
            }
            _ => Ok(Self {}),
        }
    }

    /// How many there are.
    pub(crate) fn size(&self) -> u32 {
        #[cfg(feature = "mpi")]
        if let Some(world) = &self.world {
            return world.size();
        }
        1
    }

    /// The number of this one.
    pub(crate) fn rank(&self) -> u32 {
        #[cfg(feature = "mpi")]
        if let Some(world) = &self.world {
            return world.rank();
        }
        0
    }

    /// What carries messages to the others.
    fn transport(&mut self) -> Box<dyn Transport + '_> {
        #[cfg(feature = "mpi")]
        if let Some(world) = &mut self.world {
            return Box::new(world.transport());
        }
        Box::new(local::network(1, local::Weather::CALM).remove(0))
    }

    /// Leaves the others. `done` says whether all are there still, or what went wrong here.
    pub(crate) fn leave(self, done: Result<bool>) -> Result<()> {
        let rank = self.rank();
        match done {
            Ok(is_complete) => {
                #[cfg(feature = "mpi")]
                if let Some(world) = self.world {
                    world.leave(is_complete);
                }
                let _ = is_complete;
                Ok(())
            }
            Err(error) => {
                // Others would wait here for ever. A process that ends without leaving ends them all.
                #[cfg(feature = "mpi")]
                if let Some(world) = self.world {
                    world.leave(false);
                }
                Err(error.context(format!("rank {rank} on {}", rt_cluster::host())))
            }
        }
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
    for (rank, why) in report.lost() {
        let RankReport { host, dealt_again, .. } = &report.ranks[rank];
        let host = if host.is_empty() { "an unknown machine" } else { host };
        note(format_args!(
            "warning: rank {rank} on {host} was lost ({why}): others did its {dealt_again} unfinished tiles, and the \
             result is whole"
        ));
    }
}

/// What each rank did, for people.
fn print(reports: &[ClusterReport]) -> Result<()> {
    let mut table = Table::new(&["rank", "machine", "tiles", "busy", "dealt again", "lost"]);
    let ranks = reports.iter().map(|report| report.ranks.len()).max().unwrap_or(0);
    for rank in 0..ranks {
        let all = || reports.iter().filter_map(|report| report.ranks.get(rank));
        let last = all().next_back().context("a rank of a deal")?;
        table.row(vec![
            rank.to_string(),
            last.host.clone(),
            all().map(|rank| rank.tiles).sum::<u32>().to_string(),
            seconds(all().map(|rank| rank.busy_s).sum()),
            all().map(|rank| rank.dealt_again).sum::<u32>().to_string(),
            last.lost.clone().unwrap_or_default(),
        ]);
    }
    writeln!(Stdout, "\n{table}")?;
    let makespan: f64 = reports.iter().map(|report| report.makespan_s).sum();
    let tiles: u32 = reports.iter().map(|report| report.tiles).sum();
    let messages: u64 = reports.iter().map(|report| report.messages).sum();
    let bytes = memory::size(reports.iter().map(|report| report.bytes).sum());
    writeln!(Stdout, "  {tiles} tiles in {makespan:.2} s, {messages} messages of {bytes} together")?;
    Ok(())
}
