//! Scenes.

use crate::errors::{argument, of_scene};
use crate::interrupt::interruptible;
use crate::process;
use crate::rays::{Points, double_rows, index_rows, rows};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rt_balance::{BuildError, Builder, InvalidTriangles};
use rt_scene::prepare::{self, Options, PrepareError, Prepared};
use rt_scene::progress::{LoadProgress, Watch};
use rt_scene::{Geometry, Model};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Triangles and the tree over them.
#[pyclass(frozen, module = "raybalance._raybalance")]
#[derive(Debug)]
pub(crate) struct Scene {
    pub(crate) prepared: Arc<Prepared>,
}

/// How Python asks for a scene to be prepared.
fn options(builder: Option<&str>, drop_invalid: bool) -> PyResult<Options> {
    let builder = match builder {
        Some(name) => name.parse::<Builder>().map_err(|error| argument("builder", &error))?,
        None => Builder::default(),
    };
    let invalid = if drop_invalid { InvalidTriangles::Drop } else { InvalidTriangles::Refuse };
    Ok(Options { invalid, ..Options::new(builder) })
}

/// Prepares a scene until a signal's handler raises.
fn prepared(
    py: Python<'_>,
    prepare: impl FnOnce(&mut Watch<'_>) -> Result<Prepared, PrepareError> + Send,
) -> PyResult<Scene> {
    process::check()?;
    let watched = |cancel: &AtomicBool| {
        let mut watch = |_: LoadProgress| match cancel.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        prepare(&mut watch)
    };
    let prepared = interruptible(py, watched)?.map_err(|error| of_scene(&error))?;
    Ok(Scene { prepared: Arc::new(prepared) })
}

#[pymethods]
impl Scene {
    /// A scene of arrays: `vertices` N × 3, `faces` M × 3 indices below N. Geometries have a name and a first face, in
    /// order; masks are M, or none.
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn of_arrays(
        py: Python<'_>,
        vertices: Points<'_>,
        faces: PyReadonlyArray2<'_, u32>,
        name: String,
        builder: Option<&str>,
        drop_invalid: bool,
        geometries: Vec<(String, u32)>,
        masks: Option<PyReadonlyArray1<'_, u32>>,
    ) -> PyResult<Self> {
        let options = options(builder, drop_invalid)?;
        let indices = index_rows(&faces, "faces")?.to_vec();
        let refused = |source: BuildError| of_scene(&PrepareError::Build { scene: name.clone(), source });
        let masks = masks.map(|masks| masks.as_array().to_vec()).unwrap_or_default();
        let geometries = geometries.into_iter().map(|(name, first)| Geometry { name, first }).collect();
        let model = match &vertices {
            Points::Double(vertices) => {
                Model::placed(name.as_str(), double_rows(vertices, "vertices")?, indices).map_err(refused)?
            }
            Points::Single(vertices) => Model {
                source: name.clone(),
                positions: rows(vertices, "vertices")?.to_vec(),
                indices,
                ..Model::default()
            },
        };
        let model = Model { geometries, masks, ..model };
        prepared(py, move |watch| prepare::prepare_model(model, &options, watch))
    }

    /// A scene from a file, or a built-in one by its name.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, builder: Option<&str>, drop_invalid: bool) -> PyResult<Self> {
        let options = options(builder, drop_invalid)?;
        prepared(py, move |watch| prepare::prepare(&path, &options, watch))
    }

    /// What it was made from.
    #[getter]
    fn source(&self) -> &str {
        &self.prepared.model.source
    }

    /// Vertices, N × 3, without the offset.
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let positions = &self.prepared.model.positions;
        let numbers: &[f32] = bytemuck::cast_slice(positions);
        numbers.to_vec().into_pyarray(py).reshape([positions.len(), 3])
    }

    /// Faces, M × 3 rows of `vertices`.
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let indices = &self.prepared.model.indices;
        let numbers: &[u32] = bytemuck::cast_slice(indices);
        numbers.to_vec().into_pyarray(py).reshape([indices.len(), 3])
    }

    /// What was subtracted from the coordinates that were given.
    #[getter]
    fn offset(&self) -> [f64; 3] {
        self.prepared.model.offset.to_array()
    }

    /// Number of triangles.
    #[getter]
    fn triangles(&self) -> usize {
        self.prepared.model.indices.len()
    }

    /// Name, first face and number of faces of each geometry.
    #[getter]
    fn geometries(&self) -> Vec<(&str, u32, u32)> {
        let named = &self.prepared.model.geometries;
        let name = |geometry: usize| named.get(geometry).map_or("", |geometry| geometry.name.as_str());
        let ranges = self.prepared.built.scene.geometries();
        ranges.enumerate().map(|(geometry, range)| (name(geometry), range.start, range.end - range.start)).collect()
    }

    /// Smallest and largest corner, in the coordinates that were given; `None` without triangles.
    #[getter]
    fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        let (bounds, offset) = (self.prepared.model.bounds(), self.prepared.model.offset);
        let corner = |corner: glam::Vec3| (corner.as_dvec3() + offset).to_array();
        (!bounds.is_empty()).then(|| (corner(bounds.min), corner(bounds.max)))
    }

    /// Seconds of loading and scanning, and of building the tree.
    #[getter]
    fn seconds(&self) -> (f64, f64) {
        (self.prepared.load_s, self.prepared.build_s)
    }

    /// What is worth knowing of the file: warnings, and notes on its numbers.
    #[getter]
    fn remarks(&self) -> (Vec<String>, Vec<String>) {
        (self.prepared.warnings.clone(), self.prepared.notes.clone())
    }

    /// Origins and directions of a view's rays through the middles of pixels, row by row from the upper left:
    /// (N × 3, N × 3).
    fn camera<'py>(&self, py: Python<'py>, width: u32, height: u32) -> PyResult<Rows<'py>> {
        let prepared = &self.prepared;
        let camera = prepared.view().camera().map_err(|error| PyValueError::new_err(error.to_string()))?;
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let middle = |at: u32, of: u32| (at as f32 + 0.5) / of as f32;
        let aspect = width as f32 / height as f32;
        let (mut origins, mut directions) = (Vec::new(), Vec::new());
        for (x, y) in pixels {
            let ray = camera.ray(middle(x, width), middle(y, height), aspect);
            origins.extend((ray.origin.as_dvec3() + prepared.model.offset).to_array());
            directions.extend(ray.direction.to_array());
        }
        let rows = width as usize * height as usize;
        Ok((origins.into_pyarray(py).reshape([rows, 3])?, directions.into_pyarray(py).reshape([rows, 3])?))
    }

    /// Unit normals of faces, N × 3 by the right-hand rule; 0 for a miss, which is −1.
    fn normals<'py>(
        &self,
        py: Python<'py>,
        primitives: PyReadonlyArray1<'py, i32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let model = &self.prepared.model;
        // Strided: ids are the last column of the hits.
        let ids = primitives.as_array();
        let normal = |&id: &i32| {
            let triangle = model.triangle(id.cast_unsigned());
            triangle.map_or(glam::Vec3::ZERO, |t| t.area_normal().normalize_or_zero().as_vec3()).to_array()
        };
        let numbers: Vec<f32> = ids.iter().flat_map(normal).collect();
        numbers.into_pyarray(py).reshape([ids.len(), 3])
    }
}

/// Origins and directions.
type Rows<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f32>>);
