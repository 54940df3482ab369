//! Charts of a run: who worked when, and what the estimate said against what was measured.
//!
//! | file           | made by               | shows |
//! |----------------|-----------------------|-------|
//! | `timeline.svg` | [`timeline::write_svg`] | every device's launches and pauses |
//! | `trace.json`   | [`trace::write_json`]   | the same, to zoom into (Perfetto, `chrome://tracing`) |
//! | `cost.png`     | [`cost::write_png`]     | estimated beside measured cost, pixel by pixel |
//! | `figure1.svg`, `.png` | [`figure1::write`] | tracing time against task size, as in the paper |

mod bars;
mod canvas;
pub mod cost;
pub mod figure1;
#[cfg(test)]
mod samples;
mod scale;
mod sheet;
pub mod timeline;
pub mod trace;
