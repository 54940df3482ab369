//! Materials: only their diffuse colour is used, and none of their defects stops a load.

use super::statement::Statements;
use crate::model::UNCOLOURED;
use glam::Vec3;
use std::cell::RefCell;
use std::fs;
use std::io;
use std::path::Path;

/// Loads the material files that a text names and remembers what went wrong.
pub(super) struct Materials<'a> {
    read: &'a dyn Fn(&str) -> io::Result<Vec<u8>>,
    // The parser takes a `Fn`.
    warnings: RefCell<Vec<String>>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(read: &'a dyn Fn(&str) -> io::Result<Vec<u8>>) -> Self {
        Self { read, warnings: RefCell::default() }
    }

    /// Reads and parses one file; an unreadable one leaves a warning and no materials.
    pub(super) fn load(&self, file: &Path) -> tobj::MTLLoadResult {
        let name = file.display().to_string();
        let text = match (self.read)(&name) {
            Ok(bytes) => clean(&bytes),
            Err(error) => {
                self.warn(format!("materials of {name} are missing ({error}): their faces are grey"));
                Vec::new()
            }
        };
        let result = tobj::load_mtl_buf(&mut text.as_slice());
        if let Err(error) = &result {
            self.warn(format!("materials of {name} cannot be parsed ({error}): their faces are grey"));
        }
        result
    }

    /// Colour 0 for faces without material, then one for each material, as far as 16 bits number them.
    pub(super) fn palette(&self, materials: &[tobj::Material]) -> Vec<Vec3> {
        let most = usize::from(u16::MAX);
        if materials.len() > most {
            self.warn(format!("{} materials: those after the first {most} are grey", materials.len()));
        }
        let colours = materials.iter().take(most).map(|material| {
            let colour = material.diffuse.map_or(UNCOLOURED, Vec3::from);
            if colour.is_finite() { colour.clamp(Vec3::ZERO, Vec3::ONE) } else { UNCOLOURED }
        });
        std::iter::once(UNCOLOURED).chain(colours).collect()
    }

    pub(super) fn into_warnings(self) -> Vec<String> {
        self.warnings.into_inner()
    }

    fn warn(&self, message: String) {
        let mut warnings = self.warnings.borrow_mut();
        // A file may name the same library for every group.
        if !warnings.contains(&message) {
            warnings.push(message);
        }
    }
}

/// Position in the palette of a material of the parser.
pub(super) fn colour_index(material: Option<usize>) -> u16 {
    material.and_then(|index| u16::try_from(index.checked_add(1)?).ok()).unwrap_or(0)
}

/// Reads a material file named by an OBJ file in `folder`; backslashes are tried as separators too.
pub(super) fn read_beside(folder: &Path, file: &str) -> io::Result<Vec<u8>> {
    let read = |file: &str| {
        let path = folder.join(file);
        // Opening a pipe or a terminal would wait for ever.
        if fs::metadata(&path)?.is_file() { fs::read(path) } else { Err(io::ErrorKind::InvalidInput.into()) }
    };
    read(file).or_else(|error| if file.contains('\\') { read(&file.replace('\\', "/")) } else { Err(error) })
}

/// Keeps names and diffuse colours of three numbers. `tobj` panics on a colour of fewer numbers, and one unusual value
/// in a property that we do not use would cost all materials.
fn clean(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    for statement in Statements::new(bytes) {
        match statement.keyword() {
            b"newmtl" if !statement.name().is_empty() => {
                out.extend_from_slice(b"newmtl ");
                out.extend(statement.name().bytes().map(|b| if b == b'\r' || b == b'\n' { b' ' } else { b }));
                out.push(b'\n');
            }
            b"Kd" => {
                let numbers = statement.arguments().map(|word| str::from_utf8(word).ok()?.parse::<f32>().ok());
                if let Some([r, g, b]) = numbers.take(3).collect::<Option<Vec<_>>>().as_deref() {
                    out.extend_from_slice(format!("Kd {r} {g} {b}\n").as_bytes());
                }
            }
            _ => {}
        }
    }
    out
}
