//! What a deal tells.

use serde::Serialize;

/// One deal, as rank 0 saw it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ClusterReport {
    /// Tiles that were dealt.
    pub tiles: u32,
    /// Tiles that were known before.
    pub resumed: u32,
    /// Results that came twice, of which the first counted.
    pub again: u32,
    /// Wall seconds from the first to the last of it, on rank 0.
    pub makespan_s: f64,
    /// `makespan / mean busy seconds of the ranks − 1`, without a unit; `None` where nothing was done.
    pub imbalance: Option<f64>,
    /// Messages that rank 0 sent and received.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
    /// One entry for each rank.
    pub ranks: Vec<RankReport>,
}

/// One rank's part in a deal.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RankReport {
    /// Name of its machine; empty where it was never heard of.
    pub host: String,
    /// Bytes of the largest resident set of its process up to the time it joined; `None` where its system does not
    /// tell.
    pub memory_bytes: Option<u64>,
    /// Tiles of which its result counted.
    pub tiles: u32,
    /// Wall seconds that those took.
    pub busy_s: f64,
    /// Tiles that were taken from it because it was lost, or taken for lost.
    pub dealt_again: u32,
    /// Why it did not take part to the end, if it did not.
    pub lost: Option<String>,
}

impl ClusterReport {
    /// Notes how long it took, and what follows from that.
    pub(crate) fn end(&mut self, makespan_s: f64) {
        self.makespan_s = makespan_s;
        let busy: f64 = self.ranks.iter().map(|rank| rank.busy_s).sum();
        let mean = busy / self.ranks.len().max(1) as f64;
        self.imbalance = (mean > 0.0).then(|| makespan_s / mean - 1.0);
    }

    /// The ranks that did not take part to the end, with the reason.
    pub fn lost(&self) -> impl Iterator<Item = (usize, &str)> {
        self.ranks.iter().enumerate().filter_map(|(rank, report)| Some((rank, report.lost.as_deref()?)))
    }
}
