//! The built-in scenes: a garden and a car, made by formula, the same bits on every platform.

mod car;
mod mesh;
mod yard;

use crate::Model;

/// A garden with a house: foliage on one side of the picture, sky and lawn that cost next to nothing on the other.
/// 213,802 triangles.
#[must_use]
pub fn yard() -> Model {
    yard::build()
}

/// c
#[must_use]
pub fn car() -> Model {
    car::build()
}
