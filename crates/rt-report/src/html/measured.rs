//! What pages show of any run: how well costs were estimated and work was balanced, whatever the rays were.

use super::Page;
use super::cost_map::Costs;
use crate::ReportError;
use crate::chart::cost::{CostMap, scaled_estimate};
use crate::chart::{scatter, timeline};
use crate::report::Report;
use crate::table;
use rt_balance::report::StreamRun;
use std::path::Path;

/// Most tasks whose numbers a page holds, 64 bytes each.
const MOST_TASKS: usize = 1 << 16;

/// The page of a stream of the caller's own rays, of which there is no picture.
#[derive(Debug)]
pub struct Traced<'a> {
    /// The numbers.
    pub report: &'a Report,
    /// The stream.
    pub run: &'a StreamRun,
    /// Width and height where the rays are those of a picture, row by row from the upper left: it gets a cost map. Each
    /// is below 2¹⁶.
    pub size: Option<[u32; 2]>,
}

impl Traced<'_> {
    /// Writes the page.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let runs = std::slice::from_ref(self.run);
        let title = format!("raybalance: {}", self.report.scene.source);
        let seed = self.report.provenance.seed.unwrap_or_default();
        let mut page = Page::new(&title, &self.report.provenance, &format!("Seed {seed} of samples."));
        if let Some([width, height]) = self.size {
            let mut map = CostMap::new([width, height], 1);
            let pixels: Vec<u32> = (0..height).flat_map(|y| (0..width).map(move |x| x | y << 16)).collect();
            map.add_wave(&pixels, &self.run.tasks, &scaled_estimate(self.run), &self.run.measured_s);
            add_costs(&mut page, runs, &Costs { map: &map, runs: vec![self.run] });
        }
        add_to(&mut page, self.report, runs)?;
        page.write(path)
    }
}

/// Adds what each task cost.
pub(super) fn add_costs(page: &mut Page, runs: &[StreamRun], costs: &Costs<'_>) {
    page.section("Cost of each task");
    page.paragraph(
        "Device time of the rays of each task, per ray that was traced: as estimated before (scaled to the measured \
         total) and as measured. Point at a task to read it out; with the keyboard, arrow keys go from task to task.",
    );
    if let Some(kinds) = blind(runs) {
        page.paragraph(&format!(
            "No estimate was made of {kinds} rays: it would have cost more than the expected gain. Where estimates are \
             shown here, every ray counts the same."
        ));
    }
    if costs.tasks() <= MOST_TASKS {
        costs.add_to(page);
    } else {
        page.paragraph(&format!("{} tasks are more than fit this page.", table::grouped(costs.tasks() as u64)));
    }
}

/// Adds everything that does not depend on what the rays were for.
pub(super) fn add_to(page: &mut Page, report: &Report, runs: &[StreamRun]) -> Result<(), ReportError> {
    page.section("Estimate against measurement");
    page.chart(
        &scatter::to_svg(&panels(runs))?,
        "Scatter plot: estimated against measured time of every task, one panel for each kind of rays",
        "Each dot is a task; on the line the estimate was right. Estimates are scaled to the measured total of their \
         stream, since only relative costs matter for balancing.",
    );

    page.section("Timeline");
    page.chart(
        &timeline::draw(runs),
        "Timeline: what every device did when, one panel for each stream",
        "Estimation, launches and pauses of every device.",
    );

    page.section("Streams");
    page.table("How each stream was balanced", &table::stream_table(runs));
    page.section("Devices");
    page.table("What each device did, over all streams", &table::device_table(runs));
    describe(page, report);
    Ok(())
}

fn describe(page: &mut Page, report: &Report) {
    let scene = &report.scene;
    page.section("Scene and settings");
    page.paragraph(&format!(
        "{}: {} triangles, tree of {:.1} MB by {}, {} precision.",
        scene.source,
        table::grouped(scene.triangles as u64),
        scene.bvh_bytes as f64 / 1e6,
        scene.builder,
        scene.precision
    ));
    for reason in &scene.plan.reasons {
        page.paragraph(reason);
    }
    let policy = report.policy.map_or_else(String::new, |policy| format!(", policy {policy}"));
    page.paragraph(&format!("Queue {}{policy}.", report.queue));
}

/// The kinds of rays of which nothing was known before, though the estimator could have known more.
fn blind(runs: &[StreamRun]) -> Option<String> {
    let is_blind = |run: &&StreamRun| {
        let estimate = &run.report.estimate;
        estimate.chosen == "uniform" && estimate.estimator != estimate.chosen
    };
    let mut kinds: Vec<&str> = runs.iter().filter(is_blind).map(|run| &*run.report.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    (!kinds.is_empty()).then(|| kinds.join(", "))
}

/// One panel for each kind of rays, over all frames and waves.
fn panels(runs: &[StreamRun]) -> Vec<scatter::Panel> {
    let mut panels: Vec<scatter::Panel> = Vec::new();
    for run in runs {
        let tasks = scaled_estimate(run).into_iter().zip(&run.measured_s).map(|(e, m)| [e, *m]);
        let title = &run.report.kind;
        match panels.iter_mut().find(|panel| panel.title == *title) {
            Some(panel) => panel.tasks.extend(tasks),
            None => panels.push(scatter::Panel { title: title.clone(), tasks: tasks.collect() }),
        }
    }
    if panels.is_empty() {
        panels.push(scatter::Panel { title: "nothing was traced".to_owned(), tasks: Vec::new() });
    }
    panels
}
