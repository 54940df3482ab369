//! What several processes did.

use super::{Table, seconds};
use rt_cluster::{ClusterReport, RankReport};

/// What each rank did over several deals.
#[must_use]
pub fn rank_table(deals: &[ClusterReport]) -> Table {
    let mut table = Table::new(&["rank", "machine", "memory", "tiles", "busy", "dealt again", "lost"]);
    let ranks = deals.iter().map(|deal| deal.ranks.len()).max().unwrap_or(0);
    for rank in 0..ranks {
        let all = || deals.iter().filter_map(|deal| deal.ranks.get(rank));
        let Some(last) = all().next_back() else { continue };
        table.row(vec![
            rank.to_string(),
            last.host.clone(),
            last.memory_bytes.map_or_else(String::new, |bytes| format!("{} MB", bytes.div_ceil(1_000_000))),
            all().map(|rank| rank.tiles).sum::<u32>().to_string(),
            seconds(all().map(|rank| rank.busy_s).sum()),
            all().map(|rank| rank.dealt_again).sum::<u32>().to_string(),
            last.lost.clone().unwrap_or_default(),
        ]);
    }
    table
}

/// Which ranks were lost in a deal that was finished nevertheless, a sentence for each.
pub fn lost_ranks(deal: &ClusterReport) -> impl Iterator<Item = String> {
    deal.lost().map(|(rank, why)| {
        let RankReport { host, dealt_again, .. } = &deal.ranks[rank];
        let host = if host.is_empty() { "an unknown machine" } else { host };
        format!(
            "rank {rank} on {host} was lost ({why}): others did its {dealt_again} unfinished tiles, and the result is \
             whole"
        )
    })
}
