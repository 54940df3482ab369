//! `raybalance devices` and `raybalance scenes`.

use crate::scene_source::generate;
use crate::table::{Table, grouped};
use anyhow::Result;
use rt_scene::scenes;
use serde_json::json;

/// Lists the devices that `--devices` can name.
pub(crate) fn devices(as_json: bool) -> Result<()> {
    let devices = crate::devices::open(None)?;
    let entries: Vec<_> = devices.iter().map(|device| (device.info(), "cpu:1")).collect();
    if as_json {
        let list: Vec<_> = entries
            .iter()
            .map(|(info, spec)| {
                json!({ "device": spec, "name": info.name, "backend": info.backend, "threads": info.units })
            })
            .collect();
        println!("{}", serde_json::to_string_pretty(&list)?);
        return Ok(());
    }
    let mut table = Table::new(&["device", "backend", "threads"]);
    for (info, _) in &entries {
        table.row(vec![info.name.clone(), info.backend.to_owned(), info.units.to_string()]);
    }
    print!("{table}");
    println!(
        "\n  --devices cpu:1,cpu:1 makes two devices of one thread, cpu:2 one of two, cpu:1@0.5 one at half speed."
    );
    Ok(())
}

/// Lists the built-in scenes.
pub(crate) fn scenes(as_json: bool) -> Result<()> {
    let triangles = |name| generate(name).map_or(0, |model| model.indices.len());
    let entries = scenes::SCENES.map(|entry| (entry, triangles(entry.name)));
    if as_json {
        let object = |(entry, triangles): (scenes::SceneEntry, usize)| json!({ "name": entry.name, "triangles": triangles, "description": entry.description });
        println!("{}", serde_json::to_string_pretty(&entries.map(object).to_vec())?);
        return Ok(());
    }
    let mut table = Table::new(&["scene", "triangles", ""]);
    for (entry, triangles) in entries {
        table.row(vec![entry.name.to_owned(), grouped(triangles as u64), entry.description.to_owned()]);
    }
    print!("{table}");
    println!("\n  Any OBJ file can be given instead: raybalance render FILE.obj");
    Ok(())
}
