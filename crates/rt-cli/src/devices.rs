//! The `--devices` list.

use crate::args::CardArgs;
use anyhow::{Context, Result, bail};
use rt_balance::cpu::CpuDevice;
use rt_balance::middleware::Throttled;
use rt_balance::vulkan::{self, GpuDevice, VulkanDevice};
use rt_balance::wgpu::{self, WgpuDevice};
use rt_core::Device;
use std::fmt::Display;
use std::sync::Arc;

/// One entry of the list: `cpu[:threads][@speed]`, `vulkan:index[@speed]` or `wgpu:index[@speed]`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spec {
    kind: Kind,
    speed: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Number of threads; 0: all cores that are left.
    Cpu(usize),
    /// Position in the order of the API's list.
    Gpu(Api, usize),
}

/// A way to graphics cards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Api {
    Vulkan,
    Wgpu,
}

/// A graphics device, or why it cannot be used.
pub(crate) type Found = Result<Arc<dyn GpuDevice>, String>;

impl Api {
    /// All of them; where several reach a card, the first is preferred.
    pub(crate) const ALL: [Self; 2] = [Self::Vulkan, Self::Wgpu];

    /// As `--devices` names it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Vulkan => "vulkan",
            Self::Wgpu => "wgpu",
        }
    }

    /// Every device, in the API's order; the error says why there are none.
    pub(crate) fn devices(self, cards: CardArgs) -> Result<Vec<Found>, String> {
        fn all<T, D: GpuDevice + 'static, E: Display>(
            found: Result<Vec<Result<T, E>>, E>,
            tuned: impl Fn(T) -> D,
        ) -> Result<Vec<Found>, String> {
            let upcast = |device| Arc::new(tuned(device)) as Arc<dyn GpuDevice>;
            let each = |found: Result<T, E>| found.map(upcast).map_err(|e| e.to_string());
            Ok(found.map_err(|e| e.to_string())?.into_iter().map(each).collect())
        }
        let (layouts, tuning) = (cards.layouts(), cards.tuning());
        match self {
            Self::Vulkan => {
                let options = vulkan::Options { layouts, ..vulkan::Options::from_env() };
                all(VulkanDevice::enumerate(options), |device| device.tuned(tuning))
            }
            Self::Wgpu => {
                let options = wgpu::Options { layouts, ..wgpu::Options::from_env() };
                all(WgpuDevice::enumerate(options), |device| device.tuned(tuning))
            }
        }
    }
}

/// A device with the entry that names it, and what its driver says of it if it is a graphics card.
pub(crate) struct Named {
    pub(crate) entry: String,
    pub(crate) device: Arc<dyn Device>,
    pub(crate) card: Option<vulkan::Card>,
}

/// Opens the devices of a list, to be used one after the other; `None` opens all cores as one, and every graphics card.
pub(crate) fn open_named(list: Option<&str>, cards: &CardArgs) -> Result<Vec<Named>> {
    let entries: Vec<String> = match list {
        None | Some("auto") => std::iter::once("cpu".to_owned()).chain(card_entries()).collect(),
        Some(list) => list.split(',').map(|entry| entry.trim().to_owned()).collect(),
    };
    let mut found = Api::ALL.map(|api| (api, None));
    let mut devices = Vec::new();
    for entry in entries {
        let (device, card): (Arc<dyn Device>, _) = match parse(&entry)? {
            Spec { kind: Kind::Gpu(api, index), speed: 1.0 } => {
                let device = card(&mut found, *cards, api, index)?;
                let card = device.card().clone();
                (device, Some(card))
            }
            _ => (open_with(Some(&entry), cards)?.pop().context("--devices: a device was not opened")?, None),
        };
        devices.push(Named { entry, device, card });
    }
    Ok(devices)
}

/// Entries for every graphics card once; software rasterisers are used only when named.
pub(crate) fn card_entries() -> Vec<String> {
    let entry = |spec: Spec| match spec.kind {
        Kind::Gpu(api, index) => Some(format!("{}:{index}", api.name())),
        Kind::Cpu(_) => None,
    };
    automatic().into_iter().filter_map(entry).collect()
}

/// The entry of the first software rasteriser, if there is one.
pub(crate) fn first_software_entry() -> Option<String> {
    Api::ALL.into_iter().find_map(|api| {
        let found = api.devices(CardArgs::default()).ok()?;
        let software = |found: &Found| found.as_ref().is_ok_and(|device| device.card().software);
        Some(format!("{}:{}", api.name(), found.iter().position(software)?))
    })
}

/// Opens the devices of a list; `None` opens one device for each core, and every graphics card.
pub(crate) fn open(list: Option<&str>) -> Result<Vec<Arc<dyn Device>>> {
    open_with(list, &CardArgs::default())
}

/// The same with choices about graphics cards.
pub(crate) fn open_with(list: Option<&str>, chosen: &CardArgs) -> Result<Vec<Arc<dyn Device>>> {
    let specs = match list {
        None | Some("auto") => automatic(),
        Some(list) => list.split(',').map(parse).collect::<Result<Vec<_>>>()?,
    };
    let threads = specs.iter().filter_map(|spec| match spec.kind {
        Kind::Cpu(threads) => Some(threads),
        Kind::Gpu(..) => None,
    });
    let mut cpus = CpuDevice::open_all(&threads.collect::<Vec<_>>()).context("--devices")?.into_iter();
    let mut cards = Api::ALL.map(|api| (api, None));
    let mut devices: Vec<Arc<dyn Device>> = Vec::new();
    for spec in specs {
        let device: Arc<dyn Device> = match spec.kind {
            Kind::Cpu(_) => Arc::new(cpus.next().context("--devices: a CPU device was not opened")?),
            Kind::Gpu(api, index) => card(&mut cards, *chosen, api, index)?,
        };
        devices.push(match spec.speed {
            1.0 => device,
            speed => Arc::new(Throttled::new(device, speed).context("--devices: a speed is above 0 and at most 1")?),
        });
    }
    Ok(devices)
}

/// A card that was named; `found` keeps the lists of APIs that were asked before.
fn card(
    found: &mut [(Api, Option<Vec<Found>>)],
    chosen: CardArgs,
    api: Api,
    index: usize,
) -> Result<Arc<dyn GpuDevice>> {
    let (_, list) = found.iter_mut().find(|(known, _)| *known == api).context("--devices: an unknown API")?;
    let list = match list {
        Some(list) => list,
        None => list.insert(api.devices(chosen).map_err(anyhow::Error::msg).context("--devices")?),
    };
    let name = api.name();
    match list.get(index) {
        Some(Ok(device)) => Ok(Arc::clone(device)),
        Some(Err(error)) => bail!("--devices: {name}:{index} cannot be used: {error}"),
        None => bail!("--devices: there is no {name}:{index}; `raybalance devices` lists what there is"),
    }
}

/// One device for each core, and every graphics card once; software rasterisers only when named.
fn automatic() -> Vec<Spec> {
    let cores = std::iter::repeat_n(Kind::Cpu(1), CpuDevice::cores());
    // A system without an API simply has no such devices.
    let lists = Api::ALL.map(|api| (api, api.devices(CardArgs::default()).unwrap_or_default()));
    let cards = lists.iter().flat_map(|(api, list)| {
        (0..).zip(list).filter_map(|(index, found)| Some((*api, index, found.as_ref().ok()?.card())))
    });
    let cards = each_once(cards.filter(|(_, _, card)| !card.software));
    cores
        .chain(cards.into_iter().map(|(api, index)| Kind::Gpu(api, index)))
        .map(|kind| Spec { kind, speed: 1.0 })
        .collect()
}

/// The cards that are not, through another API, among those before them.
fn each_once<'a>(cards: impl Iterator<Item = (Api, usize, &'a vulkan::Card)>) -> Vec<(Api, usize)> {
    let mut taken: Vec<(Api, usize, &vulkan::Card)> = Vec::new();
    for (api, index, card) in cards {
        if !taken.iter().any(|(other, _, before)| *other != api && before.may_be(card)) {
            taken.push((api, index, card));
        }
    }
    taken.into_iter().map(|(api, index, _)| (api, index)).collect()
}

fn parse(entry: &str) -> Result<Spec> {
    let entry = entry.trim();
    let (device, speed) = match entry.split_once('@') {
        Some((device, speed)) => (device, speed.parse::<f64>().ok().filter(|s| *s > 0.0 && *s <= 1.0)),
        None => (entry, Some(1.0)),
    };
    let Some(speed) = speed else {
        bail!("--devices: the speed in `{entry}` must be a number above 0 and at most 1, such as cpu:1@0.5");
    };
    let (backend, number) = match device.split_once(':') {
        Some((backend, number)) => (backend, Some(number)),
        None => (device, None),
    };
    let number = number.map(str::parse::<usize>);
    let kind = match (backend, number) {
        ("cpu", None) => Kind::Cpu(0),
        ("cpu", Some(Ok(threads @ 1..=4096))) => Kind::Cpu(threads),
        ("cpu", _) => {
            bail!("--devices: the thread count in `{entry}` must be a whole number from 1 to 4096, such as cpu:2")
        }
        (name, number) => match (Api::ALL.into_iter().find(|api| api.name() == name), number) {
            (Some(api), Some(Ok(index))) => Kind::Gpu(api, index),
            (Some(_), _) => bail!("--devices: `{entry}` needs a device's number, such as {name}:0"),
            (None, _) => bail!(
                "--devices: `{entry}` names no backend of this build; there are: cpu (cpu:THREADS), vulkan (vulkan:N), \
                 wgpu (wgpu:N)"
            ),
        },
    };
    Ok(Spec { kind, speed })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_parsed_or_explained() {
        assert_eq!(parse("cpu").unwrap(), Spec { kind: Kind::Cpu(0), speed: 1.0 });
        assert_eq!(parse(" cpu:3@0.5").unwrap(), Spec { kind: Kind::Cpu(3), speed: 0.5 });
        assert_eq!(parse("vulkan:2").unwrap(), Spec { kind: Kind::Gpu(Api::Vulkan, 2), speed: 1.0 });
        assert_eq!(parse("wgpu:1@0.5").unwrap(), Spec { kind: Kind::Gpu(Api::Wgpu, 1), speed: 0.5 });
        for bad in [
            "", "gpu", "cpu:0", "cpu:x", "cpu:1@0", "cpu:1@2", "cpu:1@", "cpu:-1", "vulkan", "vulkan:x", "wgpu",
            "wgpu:-1",
        ] {
            let message = parse(bad).unwrap_err().to_string();
            assert!(message.starts_with("--devices") && message.contains(bad), "{message}");
        }
    }

    /// Two equal cards seen through both APIs, one through wgpu only. Fails when only models are compared.
    #[test]
    fn a_card_that_two_apis_reach_is_taken_once() {
        let card = |model: u32, slot: &str| vulkan::Card {
            name: "a card".to_owned(),
            driver: String::new(),
            software: false,
            model: [1, model],
            slot: Some(slot.to_owned()),
            binding: 1,
            kernels: "",
        };
        let cards =
            [card(7, "0000:01:00.0"), card(7, "0000:02:00.0"), card(8, "0000:03:00.0"), card(7, "0000:04:00.0")];
        let [a, b, c, d] = &cards;
        let (vulkan, wgpu) = (Api::Vulkan, Api::Wgpu);
        let seen = [(vulkan, 0, a), (vulkan, 1, b), (wgpu, 0, b), (wgpu, 1, a), (wgpu, 2, c), (wgpu, 3, d)];
        assert_eq!(each_once(seen.into_iter()), [(vulkan, 0), (vulkan, 1), (wgpu, 2), (wgpu, 3)]);
    }
}
