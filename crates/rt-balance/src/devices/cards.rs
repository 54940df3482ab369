//! Graphics cards, by API and number.

use super::{ListError, Opened, Reason};
use rt_gpu::{BadVariable, Card, GpuDevice, Layouts, Tuning};
use std::fmt::Display;
use std::sync::{Arc, LazyLock};

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

/// One that is opened when it is asked for.
type Lazy = LazyLock<Found, Box<dyn FnOnce() -> Found + Send>>;

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
        Ok(self.list(options)?.iter().map(|device| LazyLock::force(device).clone()).collect())
    }

    /// The same, none of which is open yet.
    fn list(self, options: CardOptions) -> Result<Vec<Lazy>, String> {
        fn lazy<D: GpuDevice + 'static, E: Display>(open: impl FnOnce() -> Result<D, E> + Send + 'static) -> Lazy {
            let opened = || open().map(|device| Arc::new(device) as Arc<dyn GpuDevice>).map_err(|e| e.to_string());
            LazyLock::new(Box::new(opened))
        }
        let CardOptions { layouts, tuning } = options;
        match self {
            #[cfg(feature = "vulkan")]
            Self::Vulkan => {
                use crate::vulkan::{Options, VulkanDevice};
                let options = Options { layouts, ..Options::from_env().map_err(|e| e.to_string())? };
                let listed = VulkanDevice::list(options).map_err(|e| e.to_string())?.into_iter();
                Ok(listed.map(|listed| lazy(move || listed.open().map(|device| device.tuned(tuning)))).collect())
            }
            #[cfg(feature = "wgpu")]
            Self::Wgpu => {
                use crate::wgpu::{Options, WgpuDevice};
                let options = Options { layouts, ..Options::from_env().map_err(|e| e.to_string())? };
                let adapters = WgpuDevice::adapters().map_err(|e| e.to_string())?.into_iter();
                let tuned = move |device: WgpuDevice| device.tuned(tuning);
                Ok(adapters.map(|adapter| lazy(move || WgpuDevice::open(&adapter, options).map(tuned))).collect())
            }
        }
    }
}

/// The cards of each API that was asked for, of which those are open that were named; an API is asked once.
#[derive(Debug, Default)]
pub(super) struct Cards {
    options: CardOptions,
    asked: Vec<(Api, Vec<Lazy>)>,
}

impl Cards {
    pub(super) const fn new(options: CardOptions) -> Self {
        Self { options, asked: Vec::new() }
    }

    /// The card that an entry names.
    pub(super) fn open(&mut self, entry: String, api: Api, index: usize) -> Result<Opened, ListError> {
        let list = match self.asked.iter().position(|(known, _)| *known == api) {
            Some(known) => &self.asked[known].1,
            None => match api.list(self.options) {
                Ok(found) => &self.asked.push_mut((api, found)).1,
                Err(why) => return Err(ListError { entry, reason: Reason::Api(why) }),
            },
        };
        let reason = match list.get(index).map(LazyLock::force) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Fails when a card is opened that nobody named, or one twice.
    #[test]
    fn cards_that_nobody_names_stay_closed() {
        let opened = Arc::new(AtomicU32::new(0));
        let card = |place: u32| -> Lazy {
            let opened = Arc::clone(&opened);
            LazyLock::new(Box::new(move || {
                opened.fetch_add(1 << (8 * place), Ordering::Relaxed);
                Err(format!("card {place} is a fake"))
            }))
        };
        let Some(&api) = Api::ALL.first() else { return };
        let mut cards = Cards { options: CardOptions::default(), asked: vec![(api, (0..3).map(card).collect())] };
        let mut error = |index: usize| cards.open("it".to_owned(), api, index).err().map(|error| error.to_string());
        for _ in 0..2 {
            assert!(error(1).is_some_and(|error| error.contains("card 1 is a fake")));
        }
        assert!(error(3).is_some_and(|error| error.contains("there is no")));
        assert_eq!(opened.load(Ordering::Relaxed), 1 << 8);
    }

    /// Two equal cards seen through both APIs, one through wgpu only. Fails when only models are compared.
    #[cfg(all(feature = "vulkan", feature = "wgpu"))]
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
