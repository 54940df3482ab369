//! The page of `raybalance render`.

use super::Page;
use super::cost_map::Costs;
use crate::ReportError;
use crate::chart::cost::CostMap;
use crate::chart::{scatter, timeline};
use crate::report::Report;
use crate::table;
use rt_balance::report::StreamRun;
use rt_core::StreamKind;
use std::path::Path;

/// Most tasks whose numbers a page holds, 64 bytes each.
const MOST_TASKS: usize = 1 << 16;

/// What the page shows.
#[derive(Debug)]
pub struct Rendered<'a> {
    /// The numbers.
    pub report: &'a Report,
    /// The streams, in the order of the report.
    pub runs: &'a [StreamRun],
    /// Which tasks of the first frame's primary rays are where.
    pub map: &'a CostMap,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// Rays per pixel.
    pub samples: u32,
    /// The picture's file: the first frame's.
    pub picture: &'a Path,
    /// Predicted seconds of a run's tasks, on the scale of the measured ones.
    pub estimated: fn(&StreamRun) -> Vec<f64>,
}

impl Rendered<'_> {
    /// Writes the page.
    ///
    /// # Errors
    /// When the picture cannot be read or the page not be written.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let scene = &self.report.scene;
        let seed = self.report.provenance.seed.unwrap_or_default();
        let seeds = format!("Seed {seed} of samples, pixels and bounces.");
        let title = format!("raybalance: {}", scene.source);
        let mut page = Page::new(&title, &self.report.provenance, &seeds);
        page.section("Picture");
        let [width, height] = self.size;
        page.picture(
            self.picture,
            &format!("{} rendered with {} rays per pixel, {width} × {height} pixels", scene.source, self.samples),
        )?;

        page.section("Cost of each task");
        page.paragraph(
            "Device time of the primary rays of each task, per ray that was traced: as estimated before (scaled to the \
             measured total) and as measured. Point at a task to read it out; with the keyboard, arrow keys go from task to \
             task.",
        );
        if let Some(kinds) = self.blind() {
            page.paragraph(&format!(
                "No estimate was made of {kinds} rays: it would have cost more than the expected gain. Where estimates \
                 are shown here, every ray counts the same."
            ));
        }
        match self.costs() {
            costs if costs.tasks() <= MOST_TASKS => costs.add_to(&mut page),
            costs => page.paragraph(&format!(
                "{} tasks are more than fit this page: cost.png shows them.",
                table::grouped(costs.tasks() as u64)
            )),
        }

        page.section("Estimate against measurement");
        page.chart(
            &scatter::to_svg(&self.panels())?,
            "Scatter plot: estimated against measured time of every task, one panel for each kind of rays",
            "Each dot is a task; on the line the estimate was right. Estimates are scaled to the measured total of \
             their stream, since only relative costs matter for balancing.",
        );

        page.section("Timeline");
        page.chart(
            &timeline::draw(self.runs),
            "Timeline: what every device did when, one panel for each stream",
            "Estimation, launches and pauses of every device. trace.json has the same to zoom into.",
        );

        page.section("Streams");
        page.table("How each stream was balanced", &table::stream_table(self.runs));
        page.section("Devices");
        page.table("What each device did, over all streams", &table::device_table(self.runs));
        self.describe(&mut page);
        page.write(path)
    }

    fn describe(&self, page: &mut Page) {
        let report = self.report;
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
        page.paragraph(&format!("Queue {}{policy}. All numbers: report.json.", report.queue));
    }

    /// The kinds of rays of which nothing was known before, though the estimator could have known more.
    fn blind(&self) -> Option<String> {
        let is_blind = |run: &&StreamRun| {
            let estimate = &run.report.estimate;
            estimate.chosen == "uniform" && estimate.estimator != estimate.chosen
        };
        let mut kinds: Vec<&str> = self.runs.iter().filter(is_blind).map(|run| &*run.report.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        (!kinds.is_empty()).then(|| kinds.join(", "))
    }

    /// The first frame's primary rays.
    fn costs(&self) -> Costs<'_> {
        let first = self.runs.iter().filter(|run| run.kind == StreamKind::Primary && run.report.frame == 0);
        Costs { map: self.map, runs: first.collect(), estimated: self.estimated }
    }

    /// One panel for each kind of rays, over all frames and waves.
    fn panels(&self) -> Vec<scatter::Panel> {
        let mut panels: Vec<scatter::Panel> = Vec::new();
        for run in self.runs {
            let tasks = (self.estimated)(run).into_iter().zip(&run.measured_s).map(|(e, m)| [e, *m]);
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
}
