//! The `--devices` list.

use anyhow::{Context, Result, anyhow, bail};
use rt_balance::cpu::CpuDevice;
use rt_balance::middleware::Throttled;
use rt_balance::vulkan::{OpenError, Options, VulkanDevice};
use rt_core::Device;
use std::sync::Arc;

/// One entry of the list: `cpu[:threads][@speed]` or `vulkan:index[@speed]`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spec {
    kind: Kind,
    speed: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Number of threads; 0: all cores that are left.
    Cpu(usize),
    /// Position in the order of the system's list.
    Vulkan(usize),
}

/// A Vulkan device, or why it cannot be used.
pub(crate) type Found = Result<Arc<VulkanDevice>, OpenError>;

/// Opens the devices of a list; `None` opens one device for each core, and every graphics card.
pub(crate) fn open(list: Option<&str>) -> Result<Vec<Arc<dyn Device>>> {
    let specs = match list {
        None | Some("auto") => automatic(),
        Some(list) => list.split(',').map(parse).collect::<Result<Vec<_>>>()?,
    };
    let threads = specs.iter().filter_map(|spec| match spec.kind {
        Kind::Cpu(threads) => Some(threads),
        Kind::Vulkan(_) => None,
    });
    let mut cpus = CpuDevice::open_all(&threads.collect::<Vec<_>>()).context("--devices")?.into_iter();
    let wants_vulkan = specs.iter().any(|spec| matches!(spec.kind, Kind::Vulkan(_)));
    let vulkan = if wants_vulkan { vulkan_devices().context("--devices")? } else { Vec::new() };
    let mut devices: Vec<Arc<dyn Device>> = Vec::new();
    for spec in specs {
        let device: Arc<dyn Device> = match spec.kind {
            Kind::Cpu(_) => Arc::new(cpus.next().context("--devices: a CPU device was not opened")?),
            Kind::Vulkan(index) => match vulkan.get(index) {
                Some(Ok(device)) => Arc::clone(device) as Arc<dyn Device>,
                Some(Err(error)) => bail!("--devices: vulkan:{index} cannot be used: {error}"),
                None => bail!("--devices: there is no vulkan:{index}; `raybalance devices` lists what there is"),
            },
        };
        devices.push(match spec.speed {
            1.0 => device,
            speed => Arc::new(Throttled::new(device, speed).context("--devices: a speed is above 0 and at most 1")?),
        });
    }
    Ok(devices)
}

/// Every Vulkan device of the system, in its order.
pub(crate) fn vulkan_devices() -> Result<Vec<Found>> {
    let found = VulkanDevice::enumerate(Options::from_env()).map_err(|error| anyhow!("{error}"))?;
    Ok(found.into_iter().map(|device| device.map(Arc::new)).collect())
}

/// One device for each core, and every graphics card; software rasterisers only when named.
fn automatic() -> Vec<Spec> {
    let cores = std::iter::repeat_n(Kind::Cpu(1), CpuDevice::cores());
    let cards =
        vulkan_devices().unwrap_or_default().into_iter().enumerate().filter_map(|(index, device)| {
            device.is_ok_and(|device| !device.is_software()).then_some(Kind::Vulkan(index))
        });
    cores.chain(cards).map(|kind| Spec { kind, speed: 1.0 }).collect()
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
        ("vulkan", Some(Ok(index))) => Kind::Vulkan(index),
        ("vulkan", _) => bail!("--devices: `{entry}` needs a device's number, such as vulkan:0"),
        _ => bail!(
            "--devices: `{entry}` names no backend of this build; there are: cpu (cpu:THREADS), vulkan (vulkan:N)"
        ),
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
        assert_eq!(parse("vulkan:2").unwrap(), Spec { kind: Kind::Vulkan(2), speed: 1.0 });
        for bad in
            ["", "gpu", "cpu:0", "cpu:x", "cpu:1@0", "cpu:1@2", "cpu:1@", "cpu:-1", "vulkan", "vulkan:x", "wgpu:0"]
        {
            let message = parse(bad).unwrap_err().to_string();
            assert!(message.starts_with("--devices") && message.contains(bad), "{message}");
        }
    }
}
