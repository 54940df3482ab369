//! Maps from a part's own coordinates to those of the whole, and the functions that curves are made of.

use glam::Vec3;

/// An affine map from a part's own coordinates to those of the whole.
#[derive(Clone, Copy, Debug)]
pub(in crate::builtin) struct Frame {
    origin: Vec3,
    axes: [Vec3; 3],
}

impl Frame {
    /// The map that moves nothing.
    pub(in crate::builtin) const IDENTITY: Self = Self { origin: Vec3::ZERO, axes: Vec3::AXES };

    /// A move to `origin`.
    pub(in crate::builtin) const fn at(origin: Vec3) -> Self {
        Self { origin, axes: Vec3::AXES }
    }

    /// Mirrors across the plane z = 0.
    pub(in crate::builtin) const MIRROR_Z: Self = Self { origin: Vec3::ZERO, axes: [Vec3::X, Vec3::Y, Vec3::NEG_Z] };

    /// The same place with the x axis turned towards −z (counter-clockwise seen from above) by `radians`.
    pub(in crate::builtin) fn turned(self, radians: f32) -> Self {
        let (c, s) = circle(radians);
        let [x, y, z] = self.axes;
        Self { axes: [x * c - z * s, y, x * s + z * c], ..self }
    }

    /// The same place with the x axis turned towards y by `radians`.
    pub(in crate::builtin) fn rolled(self, radians: f32) -> Self {
        let (c, s) = circle(radians);
        let [x, y, z] = self.axes;
        Self { axes: [x * c + y * s, y * c - x * s, z], ..self }
    }

    /// The same place with the y axis turned towards z by `radians`.
    pub(in crate::builtin) fn pitched(self, radians: f32) -> Self {
        let (c, s) = circle(radians);
        let [x, y, z] = self.axes;
        Self { axes: [x, y * c + z * s, z * c - y * s], ..self }
    }

    /// Axes stretched by three factors.
    pub(in crate::builtin) fn scaled(self, factors: Vec3) -> Self {
        let [x, y, z] = self.axes;
        Self { axes: [x * factors.x, y * factors.y, z * factors.z], ..self }
    }

    /// The origin moved by an offset in the frame's own axes.
    pub(in crate::builtin) fn moved(self, offset: Vec3) -> Self {
        Self { origin: self.point(offset), ..self }
    }

    /// A frame at `origin` whose y axis points along `axis`, the others square to it in an arbitrary but fixed way.
    pub(in crate::builtin) fn along(origin: Vec3, axis: Vec3) -> Self {
        let y = axis.normalize();
        let side = if y.x.abs() < 0.8 { Vec3::X } else { Vec3::Z };
        let z = side.cross(y).normalize();
        Self { origin, axes: [y.cross(z), y, z] }
    }

    /// Where the map takes a point.
    pub(in crate::builtin) fn point(&self, p: Vec3) -> Vec3 {
        self.origin + self.vector(p)
    }

    /// Where the map takes a direction.
    pub(in crate::builtin) fn vector(&self, v: Vec3) -> Vec3 {
        self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z
    }

    /// Whether the map turns clockwise into counter-clockwise.
    pub(super) fn mirrors(&self) -> bool {
        self.axes[0].cross(self.axes[1]).dot(self.axes[2]) < 0.0
    }
}

/// A unit vector in the plane of the first two axes, `turn` radians from the first.
pub(in crate::builtin) fn circle(turn: f32) -> (f32, f32) {
    (libm::cosf(turn), libm::sinf(turn))
}

/// The smooth step from 0 at `from` to 1 at `to`, flat at both ends; `from` may be the larger.
pub(in crate::builtin) fn smooth(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A bump of height 1 at `centre` that has fallen to 0.37 at a distance of `width`.
pub(in crate::builtin) fn bump(centre: f32, width: f32, x: f32) -> f32 {
    let d = (x - centre) / width;
    libm::expf(-d * d)
}
