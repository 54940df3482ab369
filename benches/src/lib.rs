//! What the benchmarks share: scenes with cameras, and options.
#![forbid(unsafe_code)]

pub mod options;

use rt_bvh::Builder;
use rt_core::{Precision, Query, RaySource};
use rt_scene::prepare::{Options, PrepareError, Prepared, prepare};
use rt_scene::progress::unwatched;
use rt_scene::streams::{self, Wave};
use std::error::Error;
use std::path::Path;

/// A stream's name, its rays, and what is asked of them.
pub type NamedStream = (&'static str, RaySource, Query);

/// A scene as the command would trace it, with a tree by `builder`: built-in, or an OBJ file, whose camera is taken
/// from a `cameras.tsv` beside it if that names it.
///
/// # Errors
/// When there is no such scene, its file cannot be loaded or its tree not be built.
pub fn open(scene: &str, builder: Builder) -> Result<Prepared, PrepareError> {
    prepare(Path::new(scene), &Options::new(builder), &mut unwatched)
}

/// The streams of a path tracer's first steps that are not empty, one path for each pixel: primary rays of an image,
/// shadow rays towards the sun and diffuse rays from what those hit; each with its name and what is asked of it.
///
/// # Errors
/// When the scene's view makes no camera.
pub fn streams(prepared: &Prepared, size: [u32; 2]) -> Result<Vec<NamedStream>, Box<dyn Error>> {
    let paths = prepared.paths(&prepared.view(), size, 1)?;
    let primary = paths.primary(&Wave::whole(size)?);
    let hits = streams::trace(&prepared.built.scene, &primary.source, primary.spec(Precision::Robust));
    let [shadow, diffuse] = paths.follow(&primary, &hits);
    let streams = [("primary", primary), ("shadow", shadow), ("diffuse", diffuse)];
    let streams = streams.into_iter().map(|(name, stream)| (name, stream.source, stream.query));
    Ok(streams.filter(|(_, source, _)| !source.is_empty()).collect())
}
