//! `raybalance devices` and `raybalance scenes`.

use crate::table::grouped;
use anyhow::Result;
use rt_lab::devices::Listing;
use rt_report::print::Stdout;
use rt_report::terminal::{self, wrapped};
use rt_scene::prepare::generate;
use rt_scene::scenes;
use serde_json::json;
use std::io::Write;

/// Lists the devices that `--devices` can name.
pub(crate) fn devices(as_json: bool) -> Result<()> {
    let listing = Listing::new(&backend_peers::backends())?;
    match as_json {
        true => writeln!(Stdout, "{}", serde_json::to_string_pretty(&listing.json())?)?,
        false => write!(Stdout, "{}", listing.text(terminal::columns()))?,
    }
    Ok(())
}

/// Lists the built-in scenes.
pub(crate) fn scenes(as_json: bool) -> Result<()> {
    let triangles = |name| generate(name).map_or(0, |model| model.indices.len());
    let entries = scenes::SCENES.map(|entry| (entry, triangles(entry.name)));
    if as_json {
        let object = |(entry, triangles): (scenes::SceneEntry, usize)| json!({ "name": entry.name, "triangles": triangles, "description": entry.description });
        writeln!(Stdout, "{}", serde_json::to_string_pretty(&entries.map(object).to_vec())?)?;
        return Ok(());
    }
    let width = terminal::columns();
    for (entry, triangles) in entries {
        let line = format!("  {:<4}  {} triangles, {}", entry.name, grouped(triangles as u64), entry.description);
        writeln!(Stdout, "{}", wrapped(&line, "        ", width))?;
    }
    let files = "  Or any file of triangles (OBJ, PLY, STL, glTF): raybalance FILE";
    Ok(writeln!(Stdout, "\n{}", wrapped(files, "  ", width))?)
}
