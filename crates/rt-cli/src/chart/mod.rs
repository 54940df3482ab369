//! Charts of a run: who worked when, and what the estimate said against what was measured.
//!
//! | file           | made by               | shows |
//! |----------------|-----------------------|-------|
//! | `timeline.svg` | [`timeline::write_svg`] | every device's launches and pauses |
//! | `trace.json`   | [`trace::write_json`]   | the same, to zoom into (Perfetto, `chrome://tracing`) |
//! | `cost.png`     | [`cost::write_png`]     | estimated beside measured cost, pixel by pixel |
//! | `precision.svg` | [`front::write_svg`]   | speed against wrong answers, a panel per scene and device |

mod bars;
mod canvas;
pub mod cost;
pub mod front;
#[cfg(test)]
mod samples;
mod scale;
mod svg;
pub mod timeline;
pub mod trace;
