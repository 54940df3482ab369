//! Ticks of an axis, and units in which numbers are short.

use crate::table;

/// Round positions `0, step, 2·step, …` up to `top`, with a step of 1, 2 or 5 times a power of ten that gives at most
/// `most` steps.
///
/// After P. Heckbert, *Nice Numbers for Graph Labels*, Graphics Gems (1990). Empty unless `top` is positive and finite.
pub(super) fn ticks(top: f64, most: u32) -> Vec<f64> {
    if !(top > 0.0 && top.is_finite()) {
        return Vec::new();
    }
    let least = top / f64::from(most.max(1));
    let power = 10_f64.powi(least.log10().floor() as i32);
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|&step| step >= least);
    let step = step.unwrap_or(10.0 * power);
    // A little slack, so that rounding never takes away the tick at the very end.
    (0..).map(|i| f64::from(i) * step).take_while(|&tick| tick <= top * (1.0 + 1e-9)).collect()
}

/// A factor that turns seconds into a unit, and the unit's name.
pub(super) fn time_unit(seconds: f64) -> (f64, &'static str) {
    match seconds {
        s if s >= 10.0 => (1.0, "s"),
        s if s >= 0.01 => (1e3, "ms"),
        s if s >= 1e-5 => (1e6, "µs"),
        _ => (1e9, "ns"),
    }
}

/// Seconds as tables show them, and shorter ones, of single rays, with three significant digits.
pub(crate) fn duration(seconds: f64) -> String {
    if seconds >= 1e-3 {
        return table::seconds(seconds);
    }
    let (factor, unit) = time_unit(seconds);
    format!("{} {unit}", significant(seconds * factor))
}

/// A number of three significant digits, or all those before the point.
pub(super) fn significant(x: f64) -> String {
    match x.abs() {
        a if a >= 100.0 => format!("{x:.0}"),
        a if a >= 10.0 => format!("{x:.1}"),
        0.0 => "0".to_owned(),
        _ => format!("{x:.2}"),
    }
}

/// A tick's label: no more digits than tell it from its neighbours.
pub(super) fn tick_label(tick: f64, step: f64) -> String {
    let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{tick:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(ticks(10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(ticks(0.73, 4), [0.0, 0.2, 0.4, 0.600_000_000_000_000_1]);
        for top in [1e-12, 3.0, 7.5, 99.0, 1e9] {
            assert!((2..=9).contains(&ticks(top, 8).len()), "{top}");
        }
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(ticks(bad, 8).is_empty());
        }
    }

    #[test]
    fn labels_are_short() {
        assert_eq!(tick_label(0.6, 0.2), "0.6");
        assert_eq!(tick_label(500.0, 100.0), "500");
        assert_eq!([2.0, 0.5123].map(duration), ["2.00 s", "512.3 ms"]);
        assert_eq!(duration(3.2e-6), "3200 ns");
    }
}
