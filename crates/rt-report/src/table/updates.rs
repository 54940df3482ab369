//! The table of a scene that moves: how it was brought up to date before each frame.

use super::{DASH, MOST_ROWS, Table, grouped, seconds};
use rt_balance::report::UpdateReport;

/// How the scene was brought up to date before each frame, and before all of them.
#[must_use]
pub fn update_table(updates: &[UpdateReport]) -> Table {
    let mut table =
        Table::new(&["frame", "tree", "its cost", "move", "fit", "build", "to devices", "built anew since"]);
    let mut shown: Vec<&UpdateReport> = updates.iter().collect();
    shown.sort_by(|a, b| b.seconds().total_cmp(&a.seconds()));
    shown.truncate(MOST_ROWS);
    shown.sort_by_key(|update| update.frame);
    let times = |parts: [f64; 4]| parts.map(|s| if s > 0.0 { seconds(s) } else { DASH.to_owned() });
    let of = |update: &UpdateReport| times([update.move_s, update.fit_s, update.build_s, update.bring_s]);
    for update in &shown {
        let growth = update.growth.map_or_else(|| DASH.to_owned(), |growth| format!("× {growth:.2}"));
        let first = [grouped(update.frame.into()), update.tree.to_owned(), growth];
        let why = update.why.clone().unwrap_or_else(|| DASH.to_owned());
        table.row(first.into_iter().chain(of(update)).chain([why]).collect());
    }
    if updates.len() > 1 {
        let name = if shown.len() < updates.len() {
            format!("all {} (the {} longest above)", grouped(updates.len() as u64), shown.len())
        } else {
            "all".to_owned()
        };
        let rebuilt = updates.iter().filter(|update| update.why.is_some()).count();
        let trees = format!("{} fitted, {rebuilt} rebuilt", updates.len() - rebuilt);
        let sum = |part: fn(&UpdateReport) -> f64| updates.iter().map(part).sum();
        let sums = [sum(|u| u.move_s), sum(|u| u.fit_s), sum(|u| u.build_s), sum(|u| u.bring_s)];
        table.row([name, trees, String::new()].into_iter().chain(times(sums)).chain([String::new()]).collect());
    }
    table.without_empty_columns()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_balance::{Cause, Update, Updated};

    fn update(frame: u32, fit_s: f64, tree: Updated) -> UpdateReport {
        let build_s = if tree == Updated::Fitted { 0.0 } else { 0.2 };
        UpdateReport::new(
            frame,
            0.001,
            &Update { tree, growth: Some(1.02), fit_s, build_s, bring_s: 0.003, sent_bytes: 0 },
        )
    }

    /// Mutants: a rebuild without its reason; a sum that leaves a frame out; the cheapest frames kept in place of the
    /// most expensive.
    #[test]
    fn every_frame_says_what_it_took_and_why() {
        let mut updates = vec![update(1, 0.01, Updated::Fitted), update(2, 0.02, Updated::Fitted)];
        let table = update_table(&updates);
        assert_eq!(table.rows()[0], ["frame", "tree", "its cost", "move", "fit", "to devices"]);
        assert_eq!(table.rows()[1], ["1", "fitted", "× 1.02", "1.0 ms", "10.0 ms", "3.0 ms"]);
        assert_eq!(table.rows()[3], ["all", "2 fitted, 0 rebuilt", "", "2.0 ms", "30.0 ms", "6.0 ms"]);
        updates.push(update(3, 0.01, Updated::Rebuilt(Cause::TooExpensive)));
        let table = update_table(&updates);
        let last = &table.rows()[3];
        assert!(last[5] == "200.0 ms" && last[7].contains("1.5 times as expensive"), "{last:?}");
        assert_eq!(table.rows()[4][1], "2 fitted, 1 rebuilt");
        let many: Vec<UpdateReport> = (1..=200).map(|i| update(i, 1e-3 * f64::from(i), Updated::Fitted)).collect();
        let table = update_table(&many);
        assert_eq!(table.rows().len(), MOST_ROWS + 2);
        assert_eq!((&*table.rows()[1][0], &*table.rows()[MOST_ROWS][0]), ("137", "200"));
    }
}
