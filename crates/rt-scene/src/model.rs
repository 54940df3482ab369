//! A model: triangles with flat colours and, for built-in scenes, a camera.

use crate::memory::{self, NoMemory};
use crate::offset::Offset;
use glam::{DVec3, Vec3};
use rt_bvh::BuildError;
use rt_core::{Aabb, Camera, CameraError, Scene, SceneError, Triangle};
use std::ops::Range;

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
    /// Whether the last two triangles are a floor that was put under it: see [`Model::add_floor`].
    pub has_floor: bool,
    /// What of it bends in the wind: see [`Wind`](crate::wind::Wind).
    pub plants: Vec<Plant>,
    /// The parts that its source tells apart, in the order of their triangles: objects and groups of OBJ files, nodes
    /// of glTF. None where it is one.
    pub geometries: Vec<Geometry>,
    /// A mask for each triangle ([`Scene::with_masks`]); none where all have all bits.
    pub masks: Vec<u32>,
}

/// A part of a model: its triangles up to those of the next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// As its source calls it; several may have one name, or none.
    pub name: String,
    /// Its first triangle.
    pub first: u32,
}

/// A part of a model that bends in the wind.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// Its vertices, which no other part uses.
    pub vertices: Range<usize>,
    /// Where it stands.
    pub foot: Vec3,
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
    /// Of a palette and, for each triangle, an index into it: none where all have the first.
    #[must_use]
    pub const fn new(palette: Vec<Vec3>, of: Vec<u16>) -> Self {
        Self { palette, of }
    }

    /// The colours.
    #[must_use]
    pub fn palette(&self) -> &[Vec3] {
        &self.palette
    }

    /// For each triangle an index into the palette; none where all have the first.
    #[must_use]
    pub fn indices(&self) -> &[u16] {
        &self.of
    }

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

/// A floor reaches so many times the model's longest side.
const FLOOR_REACH: f32 = 40.0;

/// Colour of a floor: a grey on which shadows are seen, and what is lighter or darker than it.
const FLOOR: Vec3 = Vec3::splat(0.4);

/// Colour of triangles that have none: a warm light grey, as of unglazed clay.
pub(crate) const UNCOLOURED: Vec3 = Vec3::new(0.62, 0.58, 0.53);

impl Model {
    /// A model of the caller's triangles in double precision. As for a file's, an offset is subtracted where single
    /// precision would move vertices noticeably ([`Model::offset`]).
    ///
    /// # Errors
    /// When the system refuses the memory for the vertices.
    pub fn placed(source: impl Into<String>, vertices: &[DVec3], indices: Vec<[u32; 3]>) -> Result<Self, BuildError> {
        let refused = |NoMemory { bytes }| BuildError::OutOfMemory { what: "the vertices", bytes };
        let Offset { offset, .. } = Offset::of(vertices).map_err(refused)?;
        let mut positions = memory::list(vertices.len()).map_err(refused)?;
        positions.extend(vertices.iter().map(|&vertex| (vertex - offset).as_vec3()));
        Ok(Self { source: source.into(), positions, indices, palette: vec![UNCOLOURED], offset, ..Self::default() })
    }

    /// Puts a floor under the model, two triangles behind its own: so wide that pictures do not show its end, and
    /// touched by the lowest vertex. Automatic views do not count it. A model without finite vertices gets none.
    ///
    /// # Errors
    /// When the system refuses the memory.
    pub fn add_floor(&mut self) -> Result<(), BuildError> {
        let bounds = self.bounds();
        if bounds.is_empty() || self.has_floor {
            return Ok(());
        }
        let refused = |_| BuildError::OutOfMemory { what: "the floor", bytes: size_of::<[Vec3; 4]>() as u64 };
        self.positions.try_reserve(4).map_err(refused)?;
        self.indices.try_reserve(2).map_err(refused)?;
        self.colour_of.try_reserve((self.indices.len() + 2).saturating_sub(self.colour_of.len())).map_err(refused)?;
        let (middle, reach) = ((bounds.min + bounds.max) / 2.0, FLOOR_REACH * bounds.extent().max_element());
        let reach = reach.min(f32::MAX / 4.0);
        let first = u32::try_from(self.positions.len()).unwrap_or(u32::MAX - 4);
        let corner = |[x, z]: [f32; 2]| Vec3::new(middle.x + x * reach, bounds.min.y, middle.z + z * reach);
        self.positions.extend([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(corner));
        let colour = u16::try_from(self.palette.len()).unwrap_or(0);
        self.palette.push(FLOOR);
        self.colour_of.resize(self.indices.len(), 0);
        self.colour_of.extend([colour; 2]);
        let triangles = u32::try_from(self.indices.len()).unwrap_or(u32::MAX);
        if self.geometries.is_empty() {
            self.geometries.push(Geometry { name: String::new(), first: 0 });
        }
        self.geometries.push(Geometry { name: "floor".to_owned(), first: triangles });
        if !self.masks.is_empty() {
            self.masks.extend([u32::MAX; 2]);
        }
        self.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        self.has_floor = true;
        Ok(())
    }

    /// A scene of its triangles with what the model knows of them beside: geometries and masks.
    ///
    /// # Errors
    /// When these do not fit the triangles.
    pub fn described(&self, scene: Scene) -> Result<Scene, SceneError> {
        let scene = match &self.geometries[..] {
            [] => scene,
            geometries => scene.with_geometries(geometries.iter().map(|geometry| geometry.first).collect())?,
        };
        if self.masks.is_empty() { Ok(scene) } else { scene.with_masks(self.masks.clone()) }
    }

    /// Triangles without a floor that was put under them.
    pub(crate) fn own(&self) -> &[[u32; 3]] {
        let floor = if self.has_floor { 2 } else { 0 };
        &self.indices[..self.indices.len().saturating_sub(floor)]
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: a floor that hides what is low; colours of the model's own triangles shifted; a view of the floor.
    #[test]
    fn a_floor_touches_what_is_lowest_and_changes_no_view() {
        let corners = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 5.0, 3.5), Vec3::new(1.0, 3.0, 4.0)];
        let indices = vec![[0, 1, 2]];
        let mut model = Model { positions: corners.to_vec(), indices, palette: vec![Vec3::X], ..Model::default() };
        let before = crate::view::auto_view(&model, 1.6);
        model.add_floor().unwrap();
        assert_eq!((model.indices.len(), model.colour_of.len(), model.own().len()), (3, 3, 1));
        assert_eq!((model.colour(0), model.colour(1), model.colour(2)), (Vec3::X, FLOOR, FLOOR));
        let floor = [1, 2].map(|id| model.triangle(id).unwrap());
        assert!(floor.iter().all(|triangle| triangle.bounds().min.y == 2.0 && triangle.bounds().max.y == 2.0));
        assert!(floor.iter().all(|triangle| triangle.area_normal().y > 0.0), "it is seen from above");
        assert_eq!(crate::view::auto_view(&model, 1.6), before);
        model.add_floor().unwrap();
        assert_eq!(model.indices.len(), 3);
        let names: Vec<&str> = model.geometries.iter().map(|geometry| geometry.name.as_str()).collect();
        assert_eq!((names, model.geometries[1].first), (vec!["", "floor"], 1));
        let mut nothing = Model::default();
        nothing.add_floor().unwrap();
        assert!(nothing.indices.is_empty());
    }

    /// Mutants: the offset subtracted after rounding; one where coordinates are small.
    #[test]
    fn triangles_far_from_the_origin_keep_their_digits() {
        let corners = [DVec3::ZERO, DVec3::X * 0.1, DVec3::Y * 0.1];
        let near = Model::placed("near", &corners, vec![[0, 1, 2]]).unwrap();
        assert_eq!(near.offset, DVec3::ZERO);
        let moved = corners.map(|corner| corner + DVec3::new(3.0e6, 0.0, 0.0));
        let far = Model::placed("far", &moved, vec![[0, 1, 2]]).unwrap();
        assert!(far.offset.x != 0.0 && far.offset.y == 0.0);
        for (position, corner) in far.positions.iter().zip(moved) {
            assert!((position.as_dvec3() + far.offset - corner).length() < 1e-8, "{position} of {corner}");
        }
    }
}
