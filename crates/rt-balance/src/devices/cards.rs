//! Graphics cards, by API and number.

use super::{ListError, Opened, Reason};
use rt_gpu::{BadVariable, Card, GpuDevice, Layouts, Tuning};
use std::fmt::Display;
use std::sync::Arc;

/// A way to graphics cards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Api {
    /// Vulkan, by the feature `vulkan`.
    #[cfg(feature = "vulkan")]
    Vulkan,
    /// What wgpu has on this system, by the feature `wgpu`.
    #[cfg(feature = "wgpu")]
    Wgpu,
}

/// A graphics device, or why it cannot be used.
pub type Found = Result<Arc<dyn GpuDevice>, String>;

/// Choices about graphics cards, none of which changes a hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CardOptions {
    /// The trees that hits are found and tests are counted over; `None` leaves the choice to the backend.
    pub layouts: Option<Layouts>,
    /// How launches are made.
    pub tuning: Tuning,
}

impl Api {
    /// All of this build; where several reach a card, the first is preferred.
    pub const ALL: &[Self] = &[
        #[cfg(feature = "vulkan")]
        Self::Vulkan,
        #[cfg(feature = "wgpu")]
        Self::Wgpu,
    ];

    /// As lists name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            #[cfg(feature = "vulkan")]
            Self::Vulkan => "vulkan",
            #[cfg(feature = "wgpu")]
            Self::Wgpu => "wgpu",
        }
    }

    /// Whether the environment variables that the backend reads say what they can say.
    fn check_environment(self) -> Result<(), BadVariable> {
        match self {
            #[cfg(feature = "vulkan")]
            Self::Vulkan => crate::vulkan::Options::from_env().map(drop),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => crate::wgpu::Options::from_env().map(drop),
        }
    }

    /// Every device, in the API's order.
    ///
    /// # Errors
    /// When the system has no such API; the text says why.
    pub fn devices(self, options: CardOptions) -> Result<Vec<Found>, String> {
        fn all<T, D: GpuDevice + 'static, E: Display>(
            found: Result<Vec<Result<T, E>>, E>,
            tuned: impl Fn(T) -> D,
        ) -> Result<Vec<Found>, String> {
            let upcast = |device| Arc::new(tuned(device)) as Arc<dyn GpuDevice>;
            let each = |found: Result<T, E>| found.map(upcast).map_err(|e| e.to_string());
            Ok(found.map_err(|e| e.to_string())?.into_iter().map(each).collect())
        }
        let CardOptions { layouts, tuning } = options;
        match self {
            #[cfg(feature = "vulkan")]
            Self::Vulkan => {
                use crate::vulkan::{Options, VulkanDevice};
                let options = Options { layouts, ..Options::from_env().map_err(|e| e.to_string())? };
                all(VulkanDevice::enumerate(options), |device| device.tuned(tuning))
            }
            #[cfg(feature = "wgpu")]
            Self::Wgpu => {
                use crate::wgpu::{Options, WgpuDevice};
                let options = Options { layouts, ..Options::from_env().map_err(|e| e.to_string())? };
                all(WgpuDevice::enumerate(options), |device| device.tuned(tuning))
            }
        }
    }
}

/// The cards of each API that was asked for; an API is asked once.
#[derive(Debug, Default)]
pub(super) struct Cards {
    options: CardOptions,
    asked: Vec<(Api, Vec<Found>)>,
}

impl Cards {
    pub(super) const fn new(options: CardOptions) -> Self {
        Self { options, asked: Vec::new() }
    }

    /// The card that an entry names.
    pub(super) fn open(&mut self, entry: String, api: Api, index: usize) -> Result<Opened, ListError> {
        let list = match self.asked.iter().position(|(known, _)| *known == api) {
            Some(known) => &self.asked[known].1,
            None => match api.devices(self.options) {
                Ok(found) => &self.asked.push_mut((api, found)).1,
                Err(why) => return Err(ListError { entry, reason: Reason::Api(why) }),
            },
        };
        let reason = match list.get(index) {
            Some(Ok(device)) => {
                let card = Some(device.card().clone());
                return Ok(Opened { entry, device: Arc::clone(device) as _, card });
            }
            Some(Err(why)) => Reason::Refused(why.clone()),
            None => Reason::Missing,
        };
        Err(ListError { entry: format!("{}:{index}", api.name()), reason })
    }
}

/// Whether the environment variables of all backends say what they can say, whichever of them is used.
///
/// # Errors
/// Names a variable that does not, and what it may say.
pub fn check_environment() -> Result<(), BadVariable> {
    Api::ALL.iter().try_for_each(|api| api.check_environment())
}

/// Entries for every graphics card once.
pub(super) fn entries() -> Vec<String> {
    // A system without an API simply has no such devices.
    let devices = |api: &Api| (*api, api.devices(CardOptions::default()).unwrap_or_default());
    let lists: Vec<(Api, Vec<Found>)> = Api::ALL.iter().map(devices).collect();
    let cards = lists.iter().flat_map(|(api, list)| {
        (0..).zip(list).filter_map(|(index, found)| Some((*api, index, found.as_ref().ok()?.card())))
    });
    let once = each_once(cards.filter(|(_, _, card)| !card.software));
    once.into_iter().map(|(api, index)| format!("{}:{index}", api.name())).collect()
}

/// The entry of the first software rasteriser, if there is one.
#[must_use]
pub fn first_software_entry() -> Option<String> {
    Api::ALL.iter().find_map(|api| {
        let found = api.devices(CardOptions::default()).ok()?;
        let software = |found: &Found| found.as_ref().is_ok_and(|device| device.card().software);
        Some(format!("{}:{}", api.name(), found.iter().position(software)?))
    })
}

/// The cards that are not, through another API, among those before them.
fn each_once<'a>(cards: impl Iterator<Item = (Api, usize, &'a Card)>) -> Vec<(Api, usize)> {
    let mut taken: Vec<(Api, usize, &Card)> = Vec::new();
    for (api, index, card) in cards {
        if !taken.iter().any(|(other, _, before)| *other != api && before.may_be(card)) {
            taken.push((api, index, card));
        }
    }
    taken.into_iter().map(|(api, index, _)| (api, index)).collect()
}

#[cfg(all(test, feature = "vulkan", feature = "wgpu"))]
mod tests {
    use super::*;

    /// Two equal cards seen through both APIs, one through wgpu only. Fails when only models are compared.
    #[test]
    fn a_card_that_two_apis_reach_is_taken_once() {
        let card = |model: u32, slot: &str| Card {
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
