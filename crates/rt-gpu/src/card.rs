//! What a graphics device says of itself.

use crate::{Layouts, Profile, RayCounters};
use rt_core::Device;

/// A graphics card, or a processor that its driver presents as one, as that driver describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Card {
    /// Its name.
    pub name: String,
    /// The driver's name and version.
    pub driver: String,
    /// Whether it is a processor that its driver presents as a graphics card.
    pub software: bool,
    /// PCI's numbers of its maker and its model.
    pub model: [u32; 2],
    /// Where it sits, as `domain:bus:device.function` in hexadecimal digits, where the driver tells.
    pub slot: Option<String>,
    /// Greatest size of a buffer that a kernel may see, in bytes.
    pub binding: u64,
    /// How its kernels are compiled, in words.
    pub kernels: &'static str,
}

impl Card {
    /// Whether both may be one card, seen through two APIs. Cards of one model whose place is not known are taken for
    /// one.
    #[must_use]
    pub fn may_be(&self, other: &Self) -> bool {
        match (&self.slot, &other.slot) {
            _ if self.model != other.model => false,
            (Some(here), Some(there)) => here == there,
            _ => true,
        }
    }
}

/// A device that is a graphics card.
pub trait GpuDevice: Device {
    /// What its backend keeps of it.
    fn profile(&self) -> &Profile;

    /// Whether it makes camera rays itself: where it does not make the host's bits, the host prepares them.
    fn makes_rays(&self) -> bool;

    /// What the driver says of it.
    fn card(&self) -> &Card {
        &self.profile().card
    }

    /// What its tracers have done so far.
    fn counters(&self) -> &RayCounters {
        &self.profile().counters
    }

    /// The layouts in which it holds scenes; the two-wide tree alone where both do not fit.
    fn layouts(&self) -> Layouts {
        self.profile().layouts
    }

    /// The first ray of the trials that it makes otherwise than the host, in words; `None` if it makes them all right.
    ///
    /// # Errors
    /// When the kernel cannot be compiled or the device is lost.
    /// So does a backend that was built without the feature `test-support` of its own.
    #[cfg(feature = "test-support")]
    fn fault_of_bounces(&self, trials: &[crate::bounce::Trial]) -> Result<Option<String>, rt_core::DeviceError> {
        let _ = trials;
        let kind = rt_core::DeviceErrorKind::Unsupported;
        Err(rt_core::DeviceError::new(kind, "the backend was built without the feature `test-support`"))
    }
}

/// Mesa's first release whose software rasteriser runs loops to their end: 22.3 stops silently after 65,535 rounds.
const LEAST_LLVMPIPE: u32 = 25;

/// Why Mesa's software rasteriser of this version, such as `Mesa 25.0.7-2 (LLVM 15.0.6)`, must not be used; `None` if
/// it may.
#[must_use]
pub fn fault_of_llvmpipe(version: &str) -> Option<String> {
    let digits = version.split(|c: char| !c.is_ascii_digit()).find(|part| !part.is_empty());
    let number = digits.and_then(|digits| digits.parse::<u32>().ok());
    let why = format!(
        "its driver, {version:?}, ends long loops early and gives wrong hits: install Mesa {LEAST_LLVMPIPE} or later"
    );
    (number < Some(LEAST_LLVMPIPE)).then_some(why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_software_rasterisers_are_known_by_their_driver_info() {
        assert_eq!(fault_of_llvmpipe("Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)"), None);
        for old in ["Mesa 22.3.6 (LLVM 15.0.6)", "Mesa 22.3.6", ""] {
            assert!(fault_of_llvmpipe(old).is_some_and(|why| why.contains(old)), "{old}");
        }
    }

    #[test]
    fn cards_are_told_apart_by_model_and_by_place_where_both_tell() {
        let card = |model: u32, slot: Option<&str>| Card {
            name: String::new(),
            driver: String::new(),
            software: false,
            model: [0x10de, model],
            slot: slot.map(str::to_owned),
            binding: 0,
            kernels: "",
        };
        let here = card(1, Some("0000:01:00.0"));
        assert!(here.may_be(&card(1, Some("0000:01:00.0"))) && here.may_be(&card(1, None)));
        assert!(!here.may_be(&card(1, Some("0000:02:00.0"))) && !here.may_be(&card(2, None)));
    }
}
