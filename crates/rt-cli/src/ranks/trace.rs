//! `raybalance trace` by several processes: each traces ranges of the rays, rank 0 gathers and writes the hits.

use super::{explained, warn};
use crate::interrupt;
use anyhow::Result;
use rt_cluster::{ClusterReport, Deal, Finished, Relay, deal};
use rt_core::{Hit, TestCounts};
use rt_render::ranges::{RayRanges, gather};
use rt_report::print::Stdout;
use rt_report::terminal;
use std::io::Write;

/// Traces this process's part. On rank 0 `hits` and `counts` are all there afterwards; whether all processes are there
/// still, and there what was done by whom.
pub(crate) fn run(
    mut job: RayRanges<'_>,
    relay: &mut Relay<'_>,
    hits: &mut [Hit],
    mut counts: Option<&mut [TestCounts]>,
) -> Result<(bool, Option<ClusterReport>)> {
    let ranges = job.ranges;
    let about = Deal { cancel: Some(interrupt::flag()), ..Deal::new(ranges, job.fingerprint()) };
    let mut take = |finished: Finished<'_>| gather(finished, ranges, hits, counts.as_deref_mut());
    let dealt = deal(relay, &about, &mut job, &mut take).map_err(explained)?;
    Ok((dealt.is_complete, dealt.report))
}

/// What each rank did, for people.
pub(crate) fn tell(report: &ClusterReport, as_json: bool) -> Result<()> {
    warn(report);
    if !as_json {
        writeln!(Stdout, "\n{}", terminal::ranks(std::slice::from_ref(report), terminal::columns()).trim_end())?;
    }
    Ok(())
}
