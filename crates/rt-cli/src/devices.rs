//! The `--devices` list.

use anyhow::{Context, Result, bail};
use backend_cpu::CpuDevice;
use rt_balance::middleware::Throttled;
use rt_core::Device;
use std::sync::Arc;

/// One entry of the list: `backend[:threads][@speed]`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spec {
    /// 0: all cores that are left.
    threads: usize,
    speed: f64,
}

/// Opens the devices of a list; `None` opens one device for each core.
pub(crate) fn open(list: Option<&str>) -> Result<Vec<Arc<dyn Device>>> {
    let specs = match list {
        Some(list) => list.split(',').map(parse).collect::<Result<Vec<_>>>()?,
        None => vec![Spec { threads: 1, speed: 1.0 }; CpuDevice::cores()],
    };
    let threads: Vec<usize> = specs.iter().map(|spec| spec.threads).collect();
    let devices = CpuDevice::open_all(&threads).context("--devices")?;
    let throttle = |(device, spec): (CpuDevice, Spec)| -> Result<Arc<dyn Device>> {
        let device: Arc<dyn Device> = Arc::new(device);
        if spec.speed == 1.0 {
            return Ok(device);
        }
        let slowed = Throttled::new(device, spec.speed);
        Ok(Arc::new(slowed.with_context(|| format!("--devices: speed {} is not in 0..1", spec.speed))?))
    };
    devices.into_iter().zip(specs).map(throttle).collect()
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
    let (backend, threads) = device.split_once(':').unwrap_or((device, "0"));
    if backend != "cpu" {
        bail!("--devices: `{entry}` names no backend of this build; there is: cpu (write cpu:THREADS, such as cpu:1)");
    }
    match threads.parse::<usize>() {
        Ok(threads @ 0..=4096) if device == "cpu" || threads > 0 => Ok(Spec { threads, speed }),
        _ => bail!("--devices: the thread count in `{entry}` must be a whole number from 1 to 4096, such as cpu:2"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_parsed_or_explained() {
        assert_eq!(parse("cpu").unwrap(), Spec { threads: 0, speed: 1.0 });
        assert_eq!(parse(" cpu:3@0.5").unwrap(), Spec { threads: 3, speed: 0.5 });
        for bad in ["", "gpu", "cpu:0", "cpu:x", "cpu:1@0", "cpu:1@2", "cpu:1@", "cpu:-1", "vulkan:0"] {
            let message = parse(bad).unwrap_err().to_string();
            assert!(message.starts_with("--devices") && message.contains(bad), "{message}");
        }
    }
}
