//! From costs to where they lie on a scale of colours.

/// Share of the rays whose cost the colours tell apart, without a unit; the most expensive ones share the last colour,
/// so that a few outliers (a launch that was interrupted) do not darken all the rest.
const SHOWN_SHARE: f64 = 0.995;

/// The end of a scale that begins at 0, so that twice as far along the colours is twice the cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Top {
    /// Cost of the last colour, above 0.
    pub(crate) cost: f64,
    /// Whether any cost is beyond it.
    pub(crate) is_clipped: bool,
}

impl Top {
    /// For costs that stand for so many rays each. Those that are not known do not count.
    pub(crate) fn of(costs: impl IntoIterator<Item = (f64, u32)>) -> Self {
        let mut known: Vec<(f64, u32)> =
            costs.into_iter().filter(|(cost, rays)| cost.is_finite() && *rays > 0).collect();
        known.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let rays: u64 = known.iter().map(|&(_, rays)| u64::from(rays)).sum();
        let rank = (rays as f64 * SHOWN_SHARE) as u64;
        let mut before = 0;
        let shown = known.iter().find(|(_, rays)| {
            before += u64::from(*rays);
            before > rank
        });
        let top = shown.or(known.last()).map_or(0.0, |&(cost, _)| cost);
        // Something must be at the end of the scale, even if every cost is 0.
        let cost = if top > 0.0 { top } else { 1.0 };
        Self { cost, is_clipped: known.last().is_some_and(|&(last, _)| last > cost) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Fails when the scale ends at the largest cost, or counts tasks and not their rays.
    #[test]
    fn an_outlier_does_not_set_the_scale() {
        let costs = [(100.0, 999), (1e9, 1), (f64::NAN, 3), (1e9, 0)];
        assert_eq!(Top::of(costs), Top { cost: 100.0, is_clipped: true });
        assert_eq!(Top::of([(0.0, 5)]), Top { cost: 1.0, is_clipped: false });
        assert_eq!(Top::of([]), Top { cost: 1.0, is_clipped: false });
    }
}
