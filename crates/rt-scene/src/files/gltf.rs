//! glTF 2.0, as JSON or binary, read by the crate `gltf`: the nodes of its scene become one model.

use super::malformed;
use super::soup::Soup;
use crate::memory::push;
use crate::model::{Geometry, UNCOLOURED};
use crate::obj::{Fault, LoadOptions, LoadStage, Watch, unwatched};
use crate::progress::Meter;
use crate::reading::read_file;
use glam::{DMat4, Mat4, Vec3};
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::{Source, View};
use gltf::mesh::{Mode, Primitive};
use gltf::{Document, Gltf, Node};
use std::path::{Path, PathBuf};

const FORMAT: &str = "glTF";

/// Most colours of a model.
const COLOURS: usize = u16::MAX as usize;

/// Reads a file. What it names lies in `folder`.
pub(super) fn parse(
    bytes: &[u8],
    name: &str,
    folder: &Path,
    options: &LoadOptions,
    watch: &mut Watch<'_>,
) -> Result<Soup, Fault> {
    let Gltf { document, blob } = Gltf::from_slice(bytes).map_err(|error| malformed(FORMAT, error.to_string()))?;
    if let Some(extension) = document.extensions_required().find(|extension| is_geometry(extension)) {
        return Err(malformed(FORMAT, format!("it needs the extension {extension}, which is not read")));
    }
    let (buffers, files) = buffers(&document, blob, folder)?;
    let mut reader = Reader {
        buffers: &buffers,
        options,
        soup: Soup { files, ..Soup::default() },
        meshes: 0,
        skipped: 0,
        materials: document.materials().len(),
    };
    reader.soup.palette.extend(document.materials().take(COLOURS).map(|material| {
        let [r, g, b, _] = material.pbr_metallic_roughness().base_color_factor();
        Vec3::new(r, g, b).clamp(Vec3::ZERO, Vec3::ONE)
    }));
    reader.soup.palette.push(UNCOLOURED);

    // Every node once: a file in which one is below itself would never end.
    let mut seen = vec![false; document.nodes().len()];
    let mut meter = Meter::begin(LoadStage::Parsing, seen.len() as u64, watch)?;
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let mut open: Vec<(Node<'_>, DMat4)> = match &scene {
        Some(scene) => scene.nodes().map(|node| (node, DMat4::IDENTITY)).collect(),
        // A library of meshes without a scene.
        None => document.nodes().map(|node| (node, DMat4::IDENTITY)).collect(),
    };
    open.reverse();
    let mut nodes = 0;
    while let Some((node, above)) = open.pop() {
        if std::mem::replace(&mut seen[node.index()], true) {
            if scene.is_none() {
                continue;
            }
            return Err(malformed(FORMAT, format!("node {} is below two others, or below itself", node.index())));
        }
        nodes += 1;
        meter.at(nodes)?;
        let place = above * Mat4::from_cols_array_2d(&node.transform().matrix()).as_dmat4();
        if let Some(mesh) = node.mesh() {
            reader.meshes += 1;
            let before = reader.soup.triangles.len();
            for primitive in mesh.primitives() {
                reader.primitive(&primitive, place).map_err(|fault| match fault {
                    Fault::Malformed { format, reason } => {
                        Fault::Malformed { format, reason: format!("mesh {}: {reason}", mesh.index()) }
                    }
                    fault => fault,
                })?;
            }
            if reader.soup.triangles.len() > before {
                let name = node.name().or(mesh.name()).map_or_else(|| format!("node {}", node.index()), str::to_owned);
                push(&mut reader.soup.geometries, Geometry { name, first: before as u32 })?;
            }
        }
        let first = open.len();
        open.extend(node.children().map(|child| (child, place)));
        open[first..].reverse();
    }
    let Reader { mut soup, meshes, skipped, .. } = reader;
    if nodes > 1 {
        soup.notes
            .push(format!("{name}: {nodes} nodes with {meshes} meshes are one model, each mesh where its node is"));
    }
    if skipped > 0 {
        soup.warnings.push(format!("{name}: {skipped} meshes of points or lines are left out"));
    }
    Ok(soup)
}

/// Whether an extension changes what triangles there are.
fn is_geometry(extension: &str) -> bool {
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization"].contains(&extension)
}

/// The contents of all buffers, and the files that were read for them.
fn buffers(
    document: &Document,
    mut blob: Option<Vec<u8>>,
    folder: &Path,
) -> Result<(Vec<Vec<u8>>, Vec<PathBuf>), Fault> {
    let mut files = Vec::new();
    let mut all = Vec::new();
    for buffer in document.buffers() {
        let number = buffer.index();
        let bytes = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| malformed(FORMAT, format!("buffer {number} is not there")))?,
            Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => embedded(data).ok_or_else(|| {
                    malformed(FORMAT, format!("buffer {number} is embedded otherwise than by base64"))
                })?,
                None => {
                    let file = urlencoding::decode(uri)
                        .map_err(|_| malformed(FORMAT, format!("buffer {number} is in a file without a name")))?;
                    let path = folder.join(&*file);
                    let bytes = read_file(&path, &mut unwatched).map_err(|fault| match fault {
                        Fault::Read(error) => {
                            malformed(FORMAT, format!("its buffer {number}, {file}, cannot be read ({error})"))
                        }
                        fault => fault,
                    })?;
                    files.push(path);
                    bytes
                }
            },
        };
        if bytes.len() < buffer.length() {
            let (there, wanted) = (bytes.len(), buffer.length());
            return Err(malformed(FORMAT, format!("buffer {number} has {there} bytes instead of {wanted}")));
        }
        all.push(bytes);
    }
    Ok((all, files))
}

/// What a data URI holds, of which this is all but its scheme.
fn embedded(data: &str) -> Option<Vec<u8>> {
    use base64::Engine;
    let (kind, text) = data.split_once(',')?;
    kind.ends_with(";base64").then(|| base64::engine::general_purpose::STANDARD.decode(text).ok())?
}

struct Reader<'a> {
    buffers: &'a [Vec<u8>],
    options: &'a LoadOptions,
    soup: Soup,
    meshes: u64,
    /// Primitives of points and lines.
    skipped: u64,
    /// How many there are; triangles without one have the colour behind them.
    materials: usize,
}

impl Reader<'_> {
    fn primitive(&mut self, primitive: &Primitive<'_>, place: DMat4) -> Result<(), Fault> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.skipped += 1;
            return Ok(());
        }
        let positions = primitive.get(&gltf::Semantic::Positions);
        let positions = positions.ok_or_else(|| malformed(FORMAT, "a primitive has no positions"))?;
        self.check(&positions, &[DataType::F32], Dimensions::Vec3)?;
        let indices = primitive.indices();
        if let Some(indices) = &indices {
            self.check(indices, &[DataType::U8, DataType::U16, DataType::U32], Dimensions::Scalar)?;
        }
        let buffers = self.buffers;
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
        let absent = || malformed(FORMAT, "a primitive lies beyond its buffer");
        let first = self.soup.vertices.len() as u32;
        for position in reader.read_positions().ok_or_else(absent)? {
            self.soup.vertex(place.transform_point3(Vec3::from(position).as_dvec3()))?;
        }
        let count = self.soup.vertices.len() as u32 - first;
        let corners: Box<dyn Iterator<Item = u32>> = match indices {
            Some(_) => Box::new(reader.read_indices().ok_or_else(absent)?.into_u32()),
            None => Box::new(0..count),
        };
        let begin = self.soup.triangles.len();
        let mut last: [Option<u32>; 2] = [None; 2];
        for (number, corner) in (0_u64..).zip(corners) {
            if corner >= count {
                let reason = format!("index {corner} leads beyond its {count} vertices");
                return Err(malformed(FORMAT, reason));
            }
            let corner = first + corner;
            let [Some(a), Some(b)] = last else {
                last = if last[0].is_none() { [Some(corner), None] } else { [last[0], Some(corner)] };
                continue;
            };
            self.soup.triangle([a, b, corner], self.options)?;
            last = match mode {
                Mode::TriangleFan => [Some(a), Some(corner)],
                // Every second triangle of a strip is turned round.
                Mode::TriangleStrip if number % 2 == 0 => [Some(corner), Some(b)],
                Mode::TriangleStrip => [Some(a), Some(corner)],
                _ => [None; 2],
            };
        }
        let colour = primitive.material().index().unwrap_or(self.materials).min(self.soup.palette.len() - 1);
        let more = self.soup.triangles.len() - begin;
        crate::memory::grow(&mut self.soup.colour_of, more)?;
        self.soup.colour_of.extend(std::iter::repeat_n(colour as u16, more));
        Ok(())
    }

    /// That an accessor is of the kind that is read, and lies within its buffer: the crate relies on both.
    fn check(&self, accessor: &Accessor<'_>, types: &[DataType], dimensions: Dimensions) -> Result<(), Fault> {
        let number = accessor.index();
        let fault = |what: &str| malformed(FORMAT, format!("accessor {number} {what}"));
        if accessor.sparse().is_some() {
            return Err(fault("is sparse, which is not read"));
        }
        if !types.contains(&accessor.data_type()) || accessor.dimensions() != dimensions {
            return Err(fault("has other numbers than vertices or indices have"));
        }
        let Some(view) = accessor.view() else { return Err(fault("has no buffer")) };
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size);
        if accessor.count() == 0 || stride < size {
            return Err(fault("has no items, or items within each other"));
        }
        let end = (accessor.count() - 1).checked_mul(stride).and_then(|end| end.checked_add(size));
        let end = end.and_then(|end| end.checked_add(accessor.offset()));
        let is_within = end.is_some_and(|end| end <= view.length()) && self.holds(&view);
        if is_within { Ok(()) } else { Err(fault("lies beyond its buffer")) }
    }

    fn holds(&self, view: &View<'_>) -> bool {
        let bytes = self.buffers.get(view.buffer().index()).map_or(0, Vec::len);
        view.offset().checked_add(view.length()).is_some_and(|end| end <= bytes)
    }
}
