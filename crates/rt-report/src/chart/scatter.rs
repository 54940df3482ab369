//! Estimated against measured time of every task: on the diagonal where the estimate was right.

use super::axes::{LogAxis, frame, place};
use super::scale::{significant, time_unit};
use super::sheet::{BLUE, FAINT, Look, Sheet, VERMILION};
use crate::ReportError;
use rt_sched::metrics::EstimateErrors;

/// The tasks of one kind of rays.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What was traced.
    pub title: String,
    /// Estimated and measured seconds of each task; those that are not positive and finite are left out.
    pub tasks: Vec<[f64; 2]>,
}

/// Most dots of a panel: more of them cover each other, and make a large file.
const MOST_DOTS: usize = 1500;

/// Sizes in pixels.
const WIDTH: f64 = 1200.0;
const MARGIN: f64 = 28.0;
const GUTTER: f64 = 36.0;
const AXIS: f64 = 52.0;
const SIDE: f64 = 300.0;
/// From a panel's upper edge to its frame: title, two lines, and the name of the axis.
const HEAD: f64 = 82.0;
const PANEL: f64 = HEAD + SIDE + 62.0;

/// Panels beside each other.
const COLUMNS: usize = 3;

/// Draws the panels as an SVG document.
///
/// # Errors
/// When there is no panel.
pub fn to_svg(panels: &[Panel]) -> Result<String, ReportError> {
    if panels.is_empty() {
        return Err(ReportError::Nothing("a scatter plot without panels"));
    }
    let rows = panels.len().div_ceil(COLUMNS);
    let mut sheet = Sheet::new(WIDTH, MARGIN / 2.0 + rows as f64 * PANEL);
    let width = (WIDTH - 2.0 * MARGIN - (COLUMNS - 1) as f64 * GUTTER) / COLUMNS as f64;
    for (index, panel) in panels.iter().enumerate() {
        let left = MARGIN + (index % COLUMNS) as f64 * (width + GUTTER);
        panel.draw(&mut sheet, left, MARGIN / 2.0 + (index / COLUMNS) as f64 * PANEL);
    }
    Ok(sheet.to_svg())
}

impl Panel {
    fn draw(&self, sheet: &mut Sheet, left: f64, top: f64) {
        let usable = |task: &&[f64; 2]| task.iter().all(|s| *s > 0.0 && s.is_finite());
        let tasks: Vec<[f64; 2]> = self.tasks.iter().filter(usable).copied().collect();
        sheet.text(self.title.as_str(), (left, top + 12.0), Look { size: 15.0, bold: true, ..Look::default() });
        // In one line they would reach into the next panel.
        for (line, down) in self.summary(&tasks).into_iter().zip([31.0, 47.0]) {
            sheet.text(line, (left, top + down), Look { size: 12.0, color: FAINT, ..Look::default() });
        }
        let (from, upper) = (left + AXIS, top + HEAD);
        // One scale for both, so that the diagonal is at 45 degrees.
        let values = || tasks.iter().flatten().copied();
        let x = LogAxis::over(values(), from, from + SIDE);
        let y = LogAxis::over(values(), upper + SIDE, upper);
        let (factor, unit) = time_unit(values().fold(1e-9, f64::max));
        let titles = [format!("measured, {unit}"), format!("estimated, {unit}")];
        frame(sheet, &x, &y, [factor; 2], [&titles[0], &titles[1]]);
        let [low, high] = x.ends();
        sheet.line([place(&x, &y, [low, low]), place(&x, &y, [high, high])], 1.0, VERMILION);
        for [estimated, measured] in tasks.iter().step_by(tasks.len().div_ceil(MOST_DOTS).max(1)) {
            sheet.dot(place(&x, &y, [*measured, *estimated]), 1.6, BLUE);
        }
    }

    fn summary(&self, tasks: &[[f64; 2]]) -> [String; 2] {
        let [estimated, measured] = [0, 1].map(|i| tasks.iter().map(|task| task[i]).collect::<Vec<f64>>());
        let Some(errors) = EstimateErrors::new(&estimated, &measured) else {
            return ["no task of which both are known".to_owned(), String::new()];
        };
        let percent = |share: f64| significant(100.0 * share);
        [
            format!("{} tasks; error against the measured time:", errors.tasks),
            format!("mean {}%, 95th percentile {}%", percent(errors.mean_relative), percent(errors.p95)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dots_are_few_and_the_error_is_told() {
        let tasks = (1..20_000).map(|i| [f64::from(i) * 1.1e-6, f64::from(i) * 1e-6]).collect();
        let svg = to_svg(&[Panel { title: "<a>".to_owned(), tasks }]).unwrap();
        assert!((500..=MOST_DOTS).contains(&svg.matches("<circle").count()));
        // After one scale the estimates are right.
        assert!(
            ["19999 tasks; error against the measured time:", "mean 0.00%, 95th", "&lt;a&gt;"]
                .iter()
                .all(|t| svg.contains(t)),
            "{}",
            &svg[..900]
        );
    }

    #[test]
    fn unknown_times_are_left_out() {
        let tasks = vec![[1.0, f64::NAN], [f64::INFINITY, 1.0], [0.0, 0.0], [-1.0, 1.0]];
        let svg = to_svg(&[Panel { title: String::new(), tasks }]).unwrap();
        assert!(svg.contains("no task of which both") && !svg.contains("<circle"));
        assert!(to_svg(&[]).is_err());
    }
}
