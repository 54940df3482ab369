//! A model: triangles with flat colours and, for built-in scenes, a camera.

use glam::{DVec3, Vec3};
use rt_core::{Aabb, Camera, CameraError, Triangle};

/// Triangles as loaded or generated, in file order: the primitive id of a hit is an index into [`Model::indices`].
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Where it came from: a path, or `builtin:yard`.
    pub source: String,
    /// Vertex positions, [`Model::offset`] subtracted.
    pub positions: Vec<Vec3>,
    /// Three vertex indices for each triangle.
    pub indices: Vec<[u32; 3]>,
    /// Diffuse colours in linear light, each component in `0 ..= 1`; at least one.
    pub palette: Vec<Vec3>,
    /// Index into the palette for each triangle; empty when all use colour 0.
    pub colour_of: Vec<u16>,
    /// What is added to [`Model::positions`] for the coordinates of the file: 0 but where single precision could not
    /// hold those.
    pub offset: DVec3,
    /// The view that shows the model well, where one is known.
    pub view: Option<View>,
}

/// A camera's parameters as a person gives them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where the camera stands.
    pub eye: Vec3,
    /// What it looks at.
    pub target: Vec3,
    /// Which way is up.
    pub up: Vec3,
    /// Vertical field of view in degrees.
    pub fov_degrees: f32,
}

impl View {
    /// The camera.
    ///
    /// # Errors
    /// When the parameters do not make a camera.
    pub fn camera(&self) -> Result<Camera, CameraError> {
        Camera::look_at(self.eye, self.target, self.up, self.fov_degrees)
    }
}

/// The colours of a model's triangles.
#[derive(Clone, Debug, Default)]
pub struct Colours {
    palette: Vec<Vec3>,
    of: Vec<u16>,
}

impl Colours {
    /// Diffuse colour of triangle `primitive`.
    #[must_use]
    pub fn of(&self, primitive: u32) -> Vec3 {
        colour(&self.palette, &self.of, primitive)
    }
}

fn colour(palette: &[Vec3], colour_of: &[u16], primitive: u32) -> Vec3 {
    let index = colour_of.get(primitive as usize).copied().unwrap_or(0);
    palette.get(usize::from(index)).copied().unwrap_or(UNCOLOURED)
}

/// Colour of triangles that have none: a warm light grey, as of unglazed clay.
pub(crate) const UNCOLOURED: Vec3 = Vec3::new(0.62, 0.58, 0.53);

impl Model {
    /// Triangle `primitive`, or `None` beyond the last.
    #[inline]
    #[must_use]
    pub fn triangle(&self, primitive: u32) -> Option<Triangle> {
        let &[a, b, c] = self.indices.get(primitive as usize)?;
        let point = |i: u32| self.positions.get(i as usize).copied();
        Some(Triangle::new(point(a)?, point(b)?, point(c)?))
    }

    /// Diffuse colour of triangle `primitive`.
    #[must_use]
    pub fn colour(&self, primitive: u32) -> Vec3 {
        colour(&self.palette, &self.colour_of, primitive)
    }

    /// The colours without the triangles, which a scene made of them holds as well.
    #[must_use]
    pub fn into_colours(self) -> Colours {
        Colours { palette: self.palette, of: self.colour_of }
    }

    /// A point in the coordinates of the file, in those of the model. Exact to single precision of the result.
    #[must_use]
    pub fn place(&self, point: DVec3) -> Vec3 {
        (point - self.offset).as_vec3()
    }

    /// Bounds of all finite vertices.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.positions.iter().filter(|p| p.is_finite()).fold(Aabb::EMPTY, |b, &p| b.with_point(p))
    }
}
