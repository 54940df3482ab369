//! What pages show of any run: how well costs were estimated and work was balanced, whatever the rays were.

use super::{Page, cost_map};
use crate::ReportError;
use crate::chart::cost::{CostMap, Origin, TaskCosts, each_ray};
use crate::chart::{scatter, timeline};
use crate::report::Report;
use crate::table;
use rt_balance::report::StreamRun;
use std::path::Path;

/// Most tasks whose numbers a page holds over all its maps, 64 bytes each.
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
        page.lead(&self.report.headline.sentence);
        if let Some([width, height]) = self.size {
            let mut map = CostMap::new(&self.run.report.kind, [width, height]);
            map.add(self.run, each_ray(|ray| (ray % width.max(1)) | ((ray / width.max(1)) << 16)));
            add_costs(&mut page, &[map]);
        }
        add_to(&mut page, self.report, runs)?;
        page.write(path)
    }
}

/// Adds what each task cost.
pub(super) fn add_costs(page: &mut Page, maps: &[CostMap]) {
    page.section("Cost of each task");
    page.paragraph(
        "Device time of the rays of each task, per ray that was traced: as estimated (scaled to what each device took \
         in all) and as measured. Point at a task to read it out; with the keyboard, arrow keys go from task to task.",
    );
    if maps.iter().any(CostMap::is_of_animation) {
        page.paragraph("Of the frames the first and the most expensive one are shown.");
    }
    if let Some(what) = maps.iter().find_map(CostMap::not_used) {
        page.paragraph(&format!(
            "Where no estimate was made, “estimated (not used)” shows {what}: when all was traced, outside the times \
             that are given here."
        ));
    }
    let mut left = MOST_TASKS;
    for map in maps {
        let tasks = map.tasks().len();
        if tasks > left {
            let (name, tasks) = (map.name(), table::grouped(tasks as u64));
            page.paragraph(&format!("The {tasks} tasks of {name} are more than fit this page: see cost.png."));
            continue;
        }
        left -= tasks;
        cost_map::add(page, map);
    }
}

/// Adds everything that does not depend on what the rays were for.
pub(super) fn add_to(page: &mut Page, report: &Report, runs: &[StreamRun]) -> Result<(), ReportError> {
    page.section("Estimate against measurement");
    page.chart(
        &scatter::to_svg(&panels(runs))?,
        "Scatter plot: estimated against measured time of every task, one panel for each kind of rays",
        "Each dot is a task; on the line the estimate was right. Estimates are scaled to what each device took in all, \
         since only relative costs matter for balancing; where none was used, dots show what sampling would have \
         predicted.",
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
    table::device_remarks(runs).iter().for_each(|remark| page.paragraph(remark));
    if !report.updates.is_empty() {
        page.section("Moving geometry");
        page.table("How the scene was brought up to date before each frame", &table::update_table(&report.updates));
    }
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

/// One panel for each kind of rays, over all frames and waves.
fn panels(runs: &[StreamRun]) -> Vec<scatter::Panel> {
    let mut panels: Vec<scatter::Panel> = Vec::new();
    for run in runs {
        let costs = TaskCosts::of(run);
        let (kind, name) = (&run.report.kind, CostMap::name_of_estimate(costs.origin));
        let title = if costs.origin == Origin::Used { kind.clone() } else { format!("{kind}, {name}") };
        let tasks = costs.pairs(run);
        match panels.iter_mut().find(|panel| panel.title == title) {
            Some(panel) => panel.tasks.extend(tasks),
            None => panels.push(scatter::Panel { title, tasks: tasks.collect() }),
        }
    }
    if panels.is_empty() {
        panels.push(scatter::Panel { title: "nothing was traced".to_owned(), tasks: Vec::new() });
    }
    panels
}
