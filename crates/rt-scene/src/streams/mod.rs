//! Ray streams: camera rays in waves that fit the memory, and the shadow and diffuse rays that follow from their hits.
//!
//! [`Paths`] makes them all. Whoever renders, measures or checks takes its rays from there, so that what is measured is what
//! is rendered; [`Spawner`] is for rays that follow from others than a camera's.

mod path;
mod spawn;
mod sun;
mod wave;

pub use path::{PathStream, Paths};
pub use spawn::Spawner;
pub use sun::Sun;
pub use wave::{ImageSizeError, Wave, Waves};

/// Largest width and height of an image in pixels: a pixel's position is packed into two times 16 bits.
pub const MAX_SIDE: u32 = 1 << 16;
