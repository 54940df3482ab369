//! `raybalance devices` and `raybalance scenes`.

use crate::scene_source::generate;
use crate::table::{Table, grouped};
use anyhow::Result;
use rt_balance::cpu::CpuDevice;
use rt_core::Device;
use rt_scene::scenes;
use serde_json::json;

/// A device as `--devices` names it.
struct Entry {
    spec: String,
    name: String,
    backend: &'static str,
    /// Hardware threads of a CPU device.
    threads: Option<u32>,
    memory: Option<u64>,
    /// The driver of a graphics device, and whether it only plays one in software.
    driver: Option<(String, bool)>,
    /// Why it cannot be used.
    refused: Option<String>,
}

/// Lists the devices that `--devices` can name.
pub(crate) fn devices(as_json: bool) -> Result<()> {
    let cores = CpuDevice::open_all(&vec![1; CpuDevice::cores()])?;
    let cpu = |device: &CpuDevice| {
        let info = device.info();
        Entry {
            spec: "cpu:1".to_owned(),
            name: info.name.clone(),
            backend: info.backend,
            threads: Some(info.units),
            memory: None,
            driver: None,
            refused: None,
        }
    };
    let mut entries: Vec<Entry> = cores.iter().map(cpu).collect();
    // A system without Vulkan simply has no such devices.
    let (vulkan, missing) = match crate::devices::vulkan_devices() {
        Ok(found) => (found, None),
        Err(error) => (Vec::new(), Some(error)),
    };
    entries.extend(vulkan.iter().enumerate().map(|(index, found)| vulkan_entry(index, found)));
    if as_json {
        let object = |entry: &Entry| {
            let (driver, software) = entry.driver.clone().unzip();
            json!({
                "device": entry.spec, "name": entry.name, "backend": entry.backend, "threads": entry.threads,
                "memory_bytes": entry.memory, "driver": driver, "software": software, "refused": entry.refused,
            })
        };
        println!("{}", serde_json::to_string_pretty(&entries.iter().map(object).collect::<Vec<_>>())?);
        return Ok(());
    }
    let mut table = Table::new(&["--devices", "name", "driver"]);
    for entry in entries {
        let driver = match (entry.refused, entry.driver) {
            (Some(refused), _) => format!("cannot be used: {refused}"),
            (None, Some((driver, true))) => format!("software: {driver}"),
            (None, Some((driver, false))) => driver,
            (None, None) => String::new(),
        };
        table.row(vec![entry.spec, entry.name, driver]);
    }
    print!("{table}");
    if let Some(error) = missing {
        println!("\n  no Vulkan devices: {error}");
    }
    println!(
        "\n  cpu:1,cpu:1 makes two devices of one thread, cpu:2 one of two, cpu:1@0.5 one at half speed; auto takes every \
         core\n  and every graphics card, software only when named."
    );
    Ok(())
}

fn vulkan_entry(index: usize, found: &crate::devices::Found) -> Entry {
    let entry = Entry {
        spec: format!("vulkan:{index}"),
        name: "–".to_owned(),
        backend: "vulkan",
        threads: None,
        memory: None,
        driver: None,
        refused: None,
    };
    match found {
        Ok(device) => Entry {
            name: device.info().name.clone(),
            memory: device.info().memory,
            driver: Some((device.driver().to_owned(), device.is_software())),
            ..entry
        },
        Err(error) => Entry { refused: Some(error.to_string()), ..entry },
    }
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
