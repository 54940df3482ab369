//! The devices of this machine, for people and for programs.

use rt_balance::cpu::{CpuDevice, Isa, OpenError};
use rt_balance::devices::{Api, CardOptions, Found};
use rt_balance::vulkan::Card;
use rt_core::{Backend, Device, DeviceInfo};
use rt_report::table::{Table, grouped};
use rt_report::terminal::wrapped;
use serde_json::{Value, json};
use std::fmt::Write;
use std::sync::Arc;

/// A device as `--devices` names it.
#[derive(Debug)]
struct Entry {
    spec: String,
    name: String,
    backend: String,
    /// Hardware threads of a CPU device or a peer.
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

/// What lists can name on this machine.
#[derive(Debug)]
pub struct Listing {
    entries: Vec<Entry>,
    /// Why there are no devices of some backends.
    missing: Vec<String>,
}

impl Entry {
    fn of(spec: String, info: &DeviceInfo) -> Self {
        Self {
            spec,
            name: info.name.clone(),
            backend: info.backend.to_owned(),
            threads: None,
            isa: None,
            memory: info.memory,
            in_flight: Some(info.in_flight),
            card: None,
            refused: None,
        }
    }

    fn refused(spec: String, backend: &str, why: String) -> Self {
        let info = DeviceInfo::new("–", "");
        Self { backend: backend.to_owned(), in_flight: None, refused: Some(why), ..Self::of(spec, &info) }
    }

    fn card(api: Api, index: usize, found: &Found) -> Self {
        let spec = format!("{}:{index}", api.name());
        match found {
            Ok(device) => Self { card: Some(device.card().clone()), ..Self::of(spec, device.info()) },
            Err(error) => Self::refused(spec, api.name(), error.clone()),
        }
    }

    fn row(&self) -> Vec<String> {
        let mebibytes = |bytes: Option<u64>| bytes.map_or_else(String::new, |b| format!("{} MiB", grouped(b >> 20)));
        let driver = match (&self.refused, &self.card) {
            (Some(refused), _) => format!("cannot be used: {refused}"),
            (None, Some(card)) => {
                format!("{}{}; {}", if card.software { "software: " } else { "" }, card.driver, card.kernels)
            }
            (None, None) => String::new(),
        };
        let in_flight = self.in_flight.map_or_else(String::new, |n| n.to_string());
        let memory = match (self.memory, &self.card) {
            // wgpu does not tell.
            (None, Some(_)) => "not told".to_owned(),
            (memory, _) => mebibytes(memory),
        };
        let binding = mebibytes(self.card.as_ref().map(|card| card.binding));
        vec![self.spec.clone(), self.name.clone(), memory, in_flight, binding, driver]
    }

    fn json(&self) -> Value {
        let card = self.card.as_ref();
        json!({
            "device": self.spec, "name": self.name, "backend": self.backend, "threads": self.threads,
            "isa": self.isa.map(Isa::name),
            "memory_bytes": self.memory, "in_flight": self.in_flight,
            "driver": card.map(|card| &card.driver), "software": card.map(|card| card.software),
            "binding_bytes": card.map(|card| card.binding), "kernels": card.map(|card| card.kernels),
            "pci_model": card.map(|card| card.model), "pci_slot": card.and_then(|card| card.slot.as_ref()),
            "refused": self.refused,
        })
    }
}

impl Listing {
    /// Opens whatever there is of our own backends and of others.
    ///
    /// # Errors
    /// When the processor's cores cannot be opened.
    pub fn new(others: &[Arc<dyn Backend>]) -> Result<Self, OpenError> {
        let cpu = |device: &CpuDevice| Entry {
            threads: Some(device.info().units),
            isa: Some(device.isa()),
            ..Entry::of("cpu:1".to_owned(), device.info())
        };
        let cores = CpuDevice::open_all(&vec![1; CpuDevice::cores()])?;
        let mut entries: Vec<Entry> = cores.iter().map(cpu).collect();
        let mut missing = Vec::new();
        for &api in Api::ALL {
            match api.devices(CardOptions::default()) {
                Ok(found) => {
                    entries.extend(found.iter().enumerate().map(|(index, found)| Entry::card(api, index, found)));
                }
                // A system without the API simply has no such devices.
                Err(error) => missing.push(error),
            }
        }
        for backend in others {
            for entry in backend.entries() {
                match backend.open(entry.split_once(':').map(|(_, which)| which)) {
                    Ok(device) => {
                        let threads = Some(device.info().units);
                        entries.push(Entry { threads, ..Entry::of(entry, device.info()) });
                    }
                    Err(error) => missing.push(error.to_string()),
                }
            }
        }
        // Several may be missing for one reason.
        missing.dedup();
        Ok(Self { entries, missing })
    }

    /// A table, and what is not there, in lines of at most `width` columns.
    #[must_use]
    pub fn text(&self, width: usize) -> String {
        let mut table = Table::new(&["--devices", "name", "memory", "in flight", "largest buffer", "driver"]);
        self.entries.iter().for_each(|entry| table.row(entry.row()));
        let mut text = table.to_text(width);
        for error in &self.missing {
            let _ = writeln!(text, "\n{}", wrapped(&format!("  {error}"), "  ", width));
        }
        let how = "  cpu:1,cpu:1 makes two devices of one thread, cpu:2 one of two, cpu:1@0.5 one at half speed; auto \
                   takes every core and every graphics card, software only when named.";
        let _ = writeln!(text, "\n{}", wrapped(how, "  ", width));
        text
    }

    /// An object for each device, in a list.
    #[must_use]
    pub fn json(&self) -> Value {
        self.entries.iter().map(Entry::json).collect()
    }
}
