//! How medians stand in tables: with their intervals, where there are any, and a sentence about what those are worth.

use rt_balance::stats::{CONFIDENCE, Summary};

/// A median, and in brackets the interval that it is known to lie in; a dash where nothing was measured.
pub(crate) fn with_interval(summary: &Summary, number: impl Fn(f64) -> String) -> String {
    if summary.median.is_nan() {
        return "–".to_owned();
    }
    let median = number(summary.median);
    match summary.interval() {
        Some([low, high]) => format!("{median} ({}–{})", number(low), number(high)),
        None => median,
    }
}

/// What the intervals of summaries are worth of which this one is of the fewest measurements.
pub(crate) fn worth(least: &Summary) -> String {
    const ENOUGH: &str = "--repeat 6 or more gives 95%";
    match least.interval() {
        None => format!("One measurement has no interval: {ENOUGH}."),
        Some(_) => format!(
            "The intervals hold the true median {:.0}% of the time or more often{}.",
            100.0 * least.confidence,
            if least.confidence < CONFIDENCE { format!(" ({ENOUGH})") } else { String::new() }
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: an interval of one measurement, from it to itself; one that is worth 0%.
    #[test]
    fn one_measurement_has_no_interval() {
        let [one, three, six] = [1, 3, 6].map(|count| Summary::new(&(0..count).map(f64::from).collect::<Vec<_>>()));
        let shown = |summary| with_interval(summary, |value| format!("{value:.1}"));
        assert_eq!([&one, &three, &Summary::new(&[])].map(shown), ["0.0", "1.0 (0.0–2.0)", "–"]);
        assert_eq!(worth(&one), "One measurement has no interval: --repeat 6 or more gives 95%.");
        assert!(worth(&three).contains("75% of the time") && worth(&three).contains("--repeat 6"));
        assert!(worth(&six).ends_with("97% of the time or more often."), "{}", worth(&six));
    }
}
