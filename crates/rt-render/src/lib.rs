//! Pictures: camera, shadow and diffuse streams traced over the devices of a process, shaded, and gathered on a
//! [`Film`].
//!
//! A [`Renderer`] knows what stays the same over all frames, a [`Session`] the devices that trace. A part of a picture
//! ([`rt_scene::streams::Wave`]) is rendered to the sums of its own pixels, so that it does not matter which process
//! did it: [`tiles`] deals the parts to several. [`ranges`] does the same for rays of a caller's own.
#![forbid(unsafe_code)]

mod animation;
mod error;
mod film;
mod light;
pub mod memory;
mod passes;
mod plan;
pub mod ranges;
mod renderer;
mod share;
pub mod tiles;

pub use animation::Animation;
pub use error::RenderError;
pub use film::Film;
pub use light::Light;
pub use passes::{Frame, Passes, SHOW_EVERY};
pub use plan::AnimationPlan;
pub use renderer::{Part, Progress, Renderer, Session, TaskCut, Traced};
pub use share::{ShareError, Subject};
