//! `raybalance tradeoff sampling`: how many rays to sample, by which estimator, for tasks of which size.

mod estimators;
mod measure;
mod write;

use super::Options;
use super::Setting;
use anyhow::Result;
use rt_report::html::Page;

/// Two streams, each beside plain ones, in tasks of every size.
pub(super) fn passes(args: &Options) -> f64 {
    measure::passes(args.quick)
}

pub(super) fn run(setting: &Setting<'_>, page: &mut Page) -> Result<()> {
    let sweep = measure::Sweep::new(setting);
    let (mut cells, mut missing) = (Vec::new(), Vec::new());
    let scenes = &setting.args.scenes;
    for (index, scene) in scenes.iter().enumerate() {
        let (more, lacking) = sweep.measure(scene, &setting.time.equal_part(scenes.len(), index))?;
        cells.extend(more);
        missing = lacking;
    }
    write::all(setting, &cells, &missing, page)
}
