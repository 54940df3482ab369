//! Materials: only their diffuse colour is used, and none of their defects stops a load.

use super::statement::{Name, Statement, Statements};
use super::text::decode;
use super::{Fault, number};
use crate::memory::{NoMemory, list, push, spare};
use crate::model::UNCOLOURED;
use glam::{DMat3, DVec3, Vec3};
use std::borrow::Cow;
use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Which triangles have which material, by name, and where the names may be explained.
#[derive(Clone, Debug, Default)]
pub(super) struct Uses<'a> {
    /// Libraries as `mtllib` statements list them.
    libraries: Vec<Name<'a>>,
    /// Names as `usemtl` statements give them, and the line of the first statement.
    names: Vec<(Name<'a>, u64)>,
    number_of: HashMap<Name<'a>, u32>,
    /// First triangles of runs, and the number of the name that holds from there on.
    runs: Vec<(u32, Option<u32>)>,
}

impl<'a> Uses<'a> {
    /// Notes that triangles from `first` on have the material called `name`; none where the name is empty.
    pub(super) fn begin(&mut self, first: u32, name: Name<'a>, line: u64) -> Result<(), NoMemory> {
        let number = if name.is_empty() { None } else { Some(self.number(name, line)?) };
        match self.runs.last_mut() {
            Some(run) if run.1 == number => Ok(()),
            Some(run) if run.0 == first => {
                run.1 = number;
                Ok(())
            }
            _ => push(&mut self.runs, (first, number)),
        }
    }

    /// The number of a name.
    fn number(&mut self, name: Name<'a>, line: u64) -> Result<u32, NoMemory> {
        if let Some(&number) = self.number_of.get(&name) {
            return Ok(number);
        }
        let number = self.names.len() as u32;
        let bytes = (self.names.len() * size_of::<(Name<'_>, u32)>()) as u64;
        self.number_of.try_reserve(1).map_err(|_| NoMemory { bytes })?;
        self.number_of.insert(name, number);
        push(&mut self.names, (name, line))?;
        Ok(number)
    }

    /// Notes what follows `mtllib`.
    pub(super) fn add_library(&mut self, names: Name<'a>) -> Result<(), NoMemory> {
        // Some exporters name the library in front of each group.
        if names.is_empty() || self.libraries.last() == Some(&names) {
            Ok(())
        } else {
            push(&mut self.libraries, names)
        }
    }

    /// Every run of triangles, of `triangles` in all, with the number of its name.
    fn runs(&self, triangles: usize) -> impl Iterator<Item = (usize, Option<u32>)> {
        let ends = self.runs.iter().skip(1).map(|run| run.0 as usize).chain([triangles]);
        let before = self.runs.first().map_or(triangles, |run| run.0 as usize);
        let runs = self.runs.iter().zip(ends).map(|(&(first, name), end)| (end - first as usize, name));
        std::iter::once((before, None)).chain(runs)
    }
}

/// The colours of a model.
#[derive(Clone, Debug, Default)]
pub(super) struct Colours {
    /// At least one.
    pub(super) palette: Vec<Vec3>,
    /// For each triangle; empty where all have colour 0.
    pub(super) colour_of: Vec<u16>,
    /// What the user should know.
    pub(super) warnings: Vec<String>,
}

/// Reads the libraries that a text names and finds the colour of each triangle. Materials are looked up when all is
/// read, so that their names may come before them.
pub(super) fn colour(
    uses: &Uses<'_>,
    file: &str,
    triangles: usize,
    read: &dyn Fn(&str) -> io::Result<Vec<u8>>,
) -> Result<Colours, Fault> {
    spare()?;
    let mut shelf = Shelf { read, known: Known::default(), tried: HashMap::new(), missing: None, broken: Vec::new() };
    uses.libraries.iter().try_for_each(|names| shelf.load_all(&names.text()))?;
    let Shelf { known, missing, broken, .. } = shelf;
    let mut colours = Colours { palette: vec![UNCOLOURED], ..Colours::default() };
    colours.warnings.extend(missing.map(|missing| missing.warning(file)));
    colours.warnings.extend(broken);

    // Colour 0 for faces without material and unknown ones, then one for each material that is used.
    let most = usize::from(u16::MAX);
    let mut index_of = list(uses.names.len())?;
    spare()?;
    for (name, _) in &uses.names {
        let colour = known.find(&name.text());
        let fits = colours.palette.len() <= most;
        index_of.push(match colour {
            Some(_) if !fits => Some(0),
            Some(colour) => {
                push(&mut colours.palette, colour)?;
                Some((colours.palette.len() - 1) as u16)
            }
            None => None,
        });
    }
    let beyond = index_of.iter().filter(|&&index| index == Some(0)).count();
    if beyond > 0 {
        colours.warnings.push(format!("{file}: more than {most} materials: the last {beyond} are grey"));
    }
    let runs =
        || uses.runs(triangles).map(|(count, name)| (count, name.map_or(Some(0), |name| index_of[name as usize])));
    let unknown = runs().filter(|(_, index)| index.is_none()).map(|(count, _)| count).sum();
    colours.warnings.extend(unknown_materials(file, uses, &index_of, unknown));
    if colours.palette.len() > 1 {
        colours.colour_of = list(triangles)?;
        colours.colour_of.extend(runs().flat_map(|(count, index)| std::iter::repeat_n(index.unwrap_or(0), count)));
    }
    Ok(colours)
}

fn unknown_materials(file: &str, uses: &Uses<'_>, index_of: &[Option<u16>], triangles: usize) -> Option<String> {
    let mut unknown = uses.names.iter().zip(index_of).filter(|(_, index)| index.is_none()).map(|(name, _)| name);
    let (name, line) = unknown.next()?;
    let more = match unknown.count() {
        0 => String::new(),
        n => format!(" and {n} more materials"),
    };
    Some(format!("{file}:{line}: material {}{more} found in no library: {triangles} triangles are grey", name.text()))
}

/// Materials that were read.
#[derive(Debug, Default)]
struct Known {
    /// `None` for a material without a diffuse colour. The first of a name counts, as libraries are searched in order.
    by_name: HashMap<String, Option<Vec3>>,
    /// The same by names without what may be a comment behind them.
    by_short_name: HashMap<String, Option<Vec3>>,
}

impl Known {
    fn find(&self, name: &str) -> Option<Vec3> {
        let colour = self.by_name.get(name).or_else(|| self.by_short_name.get(without_comment(name)))?;
        Some(colour.unwrap_or(UNCOLOURED))
    }

    fn extend(&mut self, material: Option<(String, Option<Vec3>)>) {
        if let Some((name, colour)) = material {
            self.by_short_name.entry(without_comment(&name).to_owned()).or_insert(colour);
            self.by_name.entry(name).or_insert(colour);
        }
    }
}

/// A name without what follows a `#` that stands behind a space: a comment, unless the name itself is so.
fn without_comment(name: &str) -> &str {
    let comment = name.match_indices('#').find(|&(at, _)| name[..at].ends_with(char::is_whitespace));
    comment.map_or(name, |(at, _)| name[..at].trim_end())
}

/// The libraries of a text, as far as they were read.
struct Shelf<'a> {
    read: &'a dyn Fn(&str) -> io::Result<Vec<u8>>,
    known: Known,
    /// Names of libraries, and whether they could be read.
    tried: HashMap<String, bool>,
    missing: Option<Missing>,
    /// Warnings.
    broken: Vec<String>,
}

/// Libraries that cannot be read.
struct Missing {
    first: String,
    error: io::Error,
    more: u64,
}

impl Missing {
    fn warning(&self, file: &str) -> String {
        let Self { first, error, more } = self;
        let more = match more {
            0 => String::new(),
            n => format!(", and {n} more"),
        };
        format!("{file}: material library {first} cannot be read ({error}){more}")
    }
}

impl Shelf<'_> {
    /// Loads what an `mtllib` statement lists: one file whose name may have spaces, or several files.
    fn load_all(&mut self, names: &str) -> Result<(), Fault> {
        let uncommented = without_comment(names);
        if self.load(unquoted(names))?.is_ok() || self.load(unquoted(uncommented))?.is_ok() {
            return Ok(());
        }
        for name in split(uncommented) {
            let Err(error) = self.load(unquoted(&name))? else { continue };
            match (&mut self.missing, self.tried.insert(name.clone(), false)) {
                (Some(missing), None) => missing.more += 1,
                (Some(_), Some(_)) => {}
                (missing, _) => *missing = Some(Missing { first: name, error, more: 0 }),
            }
        }
        Ok(())
    }

    /// Loads one library, unless that was tried before.
    fn load(&mut self, name: &str) -> Result<io::Result<()>, Fault> {
        Ok(match self.tried.get(name) {
            Some(true) => Ok(()),
            Some(false) => Err(io::ErrorKind::NotFound.into()),
            None => match (self.read)(name) {
                Ok(bytes) => {
                    self.tried.insert(name.to_owned(), true);
                    self.parse(name, bytes)?;
                    Ok(())
                }
                Err(error) => Err(error),
            },
        })
    }

    /// Takes the materials of a library.
    fn parse(&mut self, name: &str, bytes: Vec<u8>) -> Result<(), Fault> {
        let text = decode(Cow::Owned(bytes))?;
        let mut material: Option<(String, Option<Vec3>)> = None;
        let mut broken: Option<(u64, u64)> = None;
        for statement in Statements::new(&text) {
            let keyword = statement.keyword();
            if keyword.eq_ignore_ascii_case(b"newmtl") {
                self.known.extend(material.take());
                material = Some((statement.name().text().into_owned(), None));
            } else if keyword.eq_ignore_ascii_case(b"Kd")
                && let Some((_, colour)) = &mut material
            {
                match diffuse(&statement) {
                    Some(found) => *colour = found,
                    None => broken.get_or_insert((statement.line, 0)).1 += 1,
                }
            }
        }
        self.known.extend(material);
        if let Some((line, count)) = broken {
            let what = if count == 1 {
                "a Kd statement that gives".to_owned()
            } else {
                format!("{count} Kd statements that give")
            };
            self.broken.push(format!("{name}:{line}: {what} no colour"));
        }
        Ok(())
    }
}

/// The colour of a `Kd` statement: `r g b`, or `r` alone for a grey, or `xyz x y z` likewise; `Some(None)` for a
/// spectrum, which is not read, and `None` for anything else.
fn diffuse(statement: &Statement<'_>) -> Option<Option<Vec3>> {
    let mut words = statement.arguments().peekable();
    let kind = words.peek()?.to_ascii_lowercase();
    if kind == b"spectral" {
        return Some(None);
    }
    let is_xyz = kind == b"xyz";
    if is_xyz {
        words.next();
    }
    let numbers: Vec<f64> = words.take(3).map(number::coordinate).collect::<Option<_>>()?;
    let colour = match numbers[..] {
        [grey] => DVec3::splat(grey),
        [r, g, b] => DVec3::new(r, g, b),
        _ => return None,
    };
    let colour = if is_xyz { XYZ_TO_RGB * colour } else { colour };
    colour.is_finite().then(|| Some(colour.clamp(DVec3::ZERO, DVec3::ONE).as_vec3()))
}

/// From CIE XYZ to linear sRGB (IEC 61966-2-1), by columns.
const XYZ_TO_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(3.240_454_2, -0.969_266_0, 0.055_643_4),
    DVec3::new(-1.537_138_5, 1.876_010_8, -0.204_025_9),
    DVec3::new(-0.498_531_4, 0.041_556_0, 1.057_225_2),
);

/// The files that a list names: a name goes up to a word that ends in `.mtl`, and what is left has one word each.
fn split(names: &str) -> Vec<String> {
    let mut files = Vec::new();
    let mut words: Vec<&str> = Vec::new();
    for word in names.split_whitespace() {
        words.push(word);
        let bytes = word.trim_end_matches('"').as_bytes();
        if bytes.last_chunk().is_some_and(|end: &[u8; 4]| end.eq_ignore_ascii_case(b".mtl")) {
            files.push(words.join(" "));
            words.clear();
        }
    }
    files.extend(words.into_iter().map(str::to_owned));
    files
}

/// A name without quotation marks around it.
fn unquoted(name: &str) -> &str {
    name.strip_prefix('"').and_then(|name| name.strip_suffix('"')).unwrap_or(name)
}

/// Reads a material file named by an OBJ file in `folder`, and says which file that is.
pub(super) fn read_beside(folder: &Path, file: &str) -> io::Result<(PathBuf, Vec<u8>)> {
    let exact = folder.join(file);
    let path = if exact.exists() { exact } else { similar(folder, file).unwrap_or(exact) };
    // Opening a pipe or a terminal would wait for ever.
    if !fs::metadata(&path)?.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    let bytes = fs::read(&path)?;
    Ok((path, bytes))
}

/// A file that is meant by a name which leads nowhere: with the separators of Windows, in upper and lower case, or in
/// the folders of the machine where it was written, in which case the one in `folder` is taken.
fn similar(folder: &Path, file: &str) -> Option<PathBuf> {
    let file = file.replace('\\', "/");
    let last = file.rsplit('/').next().unwrap_or(&file);
    let paths = [folder.join(&file), folder.join(last)];
    if let Some(path) = paths.iter().find(|path| path.exists()) {
        return Some(path.clone());
    }
    paths.iter().find_map(|path| {
        let name = path.file_name()?.to_str()?;
        let mut matches: Vec<PathBuf> = fs::read_dir(path.parent()?)
            .ok()?
            .filter_map(Result::ok)
            .filter(|entry| entry.file_name().to_str().is_some_and(|other| other.eq_ignore_ascii_case(name)))
            .map(|entry| entry.path())
            .collect();
        matches.sort();
        matches.into_iter().next()
    })
}
