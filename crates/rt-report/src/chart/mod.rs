//! Charts of a run: who worked when, and what the estimate said against what was measured.
//!
//! | file           | made by               | shows |
//! |----------------|-----------------------|-------|
//! | `timeline.svg` | [`timeline::write_svg`] | every device's launches and pauses |
//! | `trace.json`   | [`trace::write_json`]   | the same, to zoom into (Perfetto, `chrome://tracing`) |
//! | `cost.png`     | [`cost::write_png`]     | estimated beside measured cost of each kind of rays |
//! | `figure1.svg`, `.png` | [`figure1::write`] | tracing time against task size, as in the paper |
//! | `sampling-*.svg`, `build-*.svg` | [`front::to_svg`] | what one quantity costs in another |
//! | `report.html` (part) | [`scatter::to_svg`] | estimated against measured time, task by task |
//! | `precision.svg` | [`precision::to_svg`]   | speed against wrong answers, a panel per scene and device |
//! | `compare.svg` | [`intervals::to_svg`]     | how long several ways take, relative to one, with intervals |

mod axes;
mod bars;
mod canvas;
pub mod cost;
pub mod figure1;
pub mod front;
pub mod intervals;
pub mod precision;
#[cfg(test)]
pub(crate) mod samples;
mod scale;
pub mod scatter;
mod sheet;
mod svg;
pub mod timeline;
pub mod trace;

pub(crate) use scale::duration;

/// Every grey that a chart uses: what a page in the dark must turn over.
#[cfg(test)]
pub(crate) const GREYS: [[u8; 3]; 9] = [
    front::OTHERS,
    precision::COLUMN,
    sheet::PAPER,
    sheet::INK,
    sheet::FAINT,
    sheet::GRID,
    sheet::PALE,
    figure1::BLOCKS,
    figure1::ROUND_ROBIN,
];
