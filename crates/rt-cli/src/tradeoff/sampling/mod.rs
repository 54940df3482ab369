//! `raybalance tradeoff sampling`: how many rays to sample, by which estimator, for tasks of which size.

mod estimators;
mod measure;
mod write;

use super::Setting;
use crate::html::Page;
use anyhow::Result;

pub(super) fn run(setting: &Setting<'_>, page: &mut Page) -> Result<()> {
    let sweep = measure::Sweep::new(setting);
    let mut cells = Vec::new();
    for scene in &setting.args.scenes {
        cells.extend(sweep.measure(scene)?);
    }
    write::all(setting, &cells, page)
}
