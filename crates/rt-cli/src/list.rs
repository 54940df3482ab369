//! `raybalance devices` and `raybalance scenes`.

use crate::table::{Table, grouped};
use anyhow::Result;
use rt_balance::cpu::{CpuDevice, Isa};
use rt_balance::devices::{Api, CardOptions, Found};
use rt_balance::vulkan::Card;
use rt_core::Device;
use rt_report::print::Stdout;
use rt_report::terminal::{self, wrapped};
use rt_scene::prepare::generate;
use rt_scene::scenes;
use serde_json::json;
use std::io::Write;

/// A device as `--devices` names it.
struct Entry {
    spec: String,
    name: String,
    backend: &'static str,
    /// Hardware threads of a CPU device.
    threads: Option<u32>,
    /// Instructions that it traces with.
    isa: Option<Isa>,
    memory: Option<u64>,
    in_flight: Option<u32>,
    /// What is said of a graphics device.
    card: Option<Card>,
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
            isa: Some(device.isa()),
            memory: info.memory,
            in_flight: Some(info.in_flight),
            card: None,
            refused: None,
        }
    };
    let mut entries: Vec<Entry> = cores.iter().map(cpu).collect();
    let mut missing = Vec::new();
    for &api in Api::ALL {
        match api.devices(CardOptions::default()) {
            Ok(found) => entries.extend(found.iter().enumerate().map(|(index, found)| gpu_entry(api, index, found))),
            // A system without the API simply has no such devices.
            Err(error) => missing.push(error),
        }
    }
    if as_json {
        let object = |entry: &Entry| {
            let card = entry.card.as_ref();
            json!({
                "device": entry.spec, "name": entry.name, "backend": entry.backend, "threads": entry.threads,
                "isa": entry.isa.map(Isa::name),
                "memory_bytes": entry.memory, "in_flight": entry.in_flight,
                "driver": card.map(|card| &card.driver), "software": card.map(|card| card.software),
                "binding_bytes": card.map(|card| card.binding), "kernels": card.map(|card| card.kernels),
                "pci_model": card.map(|card| card.model), "pci_slot": card.and_then(|card| card.slot.as_ref()),
                "refused": entry.refused,
            })
        };
        writeln!(Stdout, "{}", serde_json::to_string_pretty(&entries.iter().map(object).collect::<Vec<_>>())?)?;
        return Ok(());
    }
    let mut table = Table::new(&["--devices", "name", "memory", "in flight", "largest buffer", "driver"]);
    for entry in entries {
        let mebibytes = |bytes: Option<u64>| bytes.map_or_else(String::new, |b| format!("{} MiB", grouped(b >> 20)));
        let driver = match (&entry.refused, &entry.card) {
            (Some(refused), _) => format!("cannot be used: {refused}"),
            (None, Some(card)) => {
                format!("{}{}; {}", if card.software { "software: " } else { "" }, card.driver, card.kernels)
            }
            (None, None) => String::new(),
        };
        let in_flight = entry.in_flight.map_or_else(String::new, |n| n.to_string());
        let memory = match (entry.memory, &entry.card) {
            // wgpu does not tell.
            (None, Some(_)) => "not told".to_owned(),
            (memory, _) => mebibytes(memory),
        };
        let binding = mebibytes(entry.card.map(|card| card.binding));
        table.row(vec![entry.spec, entry.name, memory, in_flight, binding, driver]);
    }
    let width = terminal::columns();
    write!(Stdout, "{}", table.to_text(width))?;
    for error in missing {
        writeln!(Stdout, "\n{}", wrapped(&format!("  {error}"), "  ", width))?;
    }
    let how = "  cpu:1,cpu:1 makes two devices of one thread, cpu:2 one of two, cpu:1@0.5 one at half speed; auto takes every \
               core and every graphics card, software only when named.";
    Ok(writeln!(Stdout, "\n{}", wrapped(how, "  ", width))?)
}

fn gpu_entry(api: Api, index: usize, found: &Found) -> Entry {
    let entry = Entry {
        spec: format!("{}:{index}", api.name()),
        name: "–".to_owned(),
        backend: api.name(),
        threads: None,
        isa: None,
        memory: None,
        in_flight: None,
        card: None,
        refused: None,
    };
    match found {
        Ok(device) => Entry {
            name: device.info().name.clone(),
            memory: device.info().memory,
            in_flight: Some(device.info().in_flight),
            card: Some(device.card().clone()),
            ..entry
        },
        Err(error) => Entry { refused: Some(error.clone()), ..entry },
    }
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
