//! Devices by name: lists such as `cpu:2,vulkan:0@0.5`, and what `auto` stands for on this machine.
//!
//! An entry is `cpu[:threads][@speed]`, and with the features of the same names `vulkan:index[@speed]` and
//! `wgpu:index[@speed]`. A caller's own backends ([`Backend`], [`Opener::with_backends`]) are named beside these.

use crate::cpu::{self, CpuDevice, Isa};
use crate::middleware::Throttled;
use rt_core::{Backend, Device, DeviceError};
use std::error::Error;
use std::fmt;
use std::sync::Arc;

#[cfg(feature = "gpu")]
mod cards;

#[cfg(feature = "gpu")]
pub use cards::{Api, CardOptions, Found, check_environment, first_software_entry};

/// The list that stands for whatever this machine has.
pub const AUTO: &str = "auto";

/// What entries of CPU devices begin with.
const CPU: &str = "cpu";

/// Most threads that a CPU device may be asked for.
const MOST_THREADS: usize = 4096;

/// One entry of a list.
#[derive(Clone, Copy, Debug)]
struct Spec<'a> {
    kind: Kind<'a>,
    speed: f64,
}

#[derive(Clone, Copy, Debug)]
enum Kind<'a> {
    /// Number of threads; 0: all cores that are left.
    Cpu(usize),
    /// Position in the order of the API's list.
    #[cfg(feature = "gpu")]
    Card(Api, usize),
    /// A backend of the caller's, and which of its devices.
    Other(&'a dyn Backend, Option<&'a str>),
}

/// A device, and what it was called.
#[derive(Clone, Debug)]
pub struct Opened {
    /// The entry of the list that names it.
    pub entry: String,
    /// The device.
    pub device: Arc<dyn Device>,
    /// What its driver says of it, if it is a graphics card at its own speed.
    #[cfg(feature = "gpu")]
    pub card: Option<rt_gpu::Card>,
}

impl Opened {
    /// One that is no graphics card.
    fn of(entry: &str, device: Arc<dyn Device>) -> Self {
        Self {
            entry: entry.to_owned(),
            device,
            #[cfg(feature = "gpu")]
            card: None,
        }
    }
}

/// Opens devices by name.
#[derive(Debug, Default)]
pub struct Opener {
    isa: Option<Isa>,
    /// The caller's.
    backends: Vec<Arc<dyn Backend>>,
    #[cfg(feature = "gpu")]
    cards: cards::Cards,
}

impl Opener {
    /// An opener that leaves all choices to the backends.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The same with choices about graphics cards.
    #[cfg(feature = "gpu")]
    #[must_use]
    pub fn with_cards(self, options: CardOptions) -> Self {
        Self { cards: cards::Cards::new(options), ..self }
    }

    /// The same with more backends that lists may name. Of several with one name the first counts, and those of this
    /// crate come before all.
    #[must_use]
    pub fn with_backends(mut self, backends: impl IntoIterator<Item = Arc<dyn Backend>>) -> Self {
        self.backends.extend(backends);
        self
    }

    /// The same with instructions for CPU devices; `None`: as [`CpuDevice::open_all`] chooses them.
    #[must_use]
    pub const fn with_isa(mut self, isa: Option<Isa>) -> Self {
        self.isa = isa;
        self
    }

    /// Whether a list can be read. Nothing is opened, so this says nothing of the machine.
    ///
    /// # Errors
    /// When an entry cannot be read.
    pub fn check(&self, list: &str) -> Result<(), ListError> {
        match list {
            AUTO => Ok(()),
            list => entries(list).iter().try_for_each(|entry| parse(entry, &self.backends).map(drop)),
        }
    }

    /// Opens the devices of a list that are to work at the same time: CPU devices share the cores.
    ///
    /// `auto` opens one device for each core, and every graphics card once; software rasterisers only when named.
    ///
    /// # Errors
    /// When an entry cannot be read, or its device cannot be used.
    pub fn open(&mut self, list: &str) -> Result<Vec<Opened>, ListError> {
        let entries = match list {
            AUTO => std::iter::repeat_n("cpu:1".to_owned(), CpuDevice::cores()).chain(card_entries()).collect(),
            list => entries(list),
        };
        let specs = entries.iter().map(|entry| parse(entry, &self.backends)).collect::<Result<Vec<_>, _>>()?;
        let threads = |spec: &Spec| match spec.kind {
            Kind::Cpu(threads) => Some(threads),
            _ => None,
        };
        let threads: Vec<usize> = specs.iter().filter_map(threads).collect();
        let mut cpus = CpuDevice::open_all_with(&threads, self.isa)?.into_iter();
        let mut devices = Vec::new();
        for (entry, &Spec { kind, speed }) in entries.iter().zip(&specs) {
            let mut opened = match kind {
                Kind::Cpu(_) => {
                    let device = cpus.next().expect("one was opened for each entry that names one");
                    Opened::of(entry, Arc::new(device))
                }
                #[cfg(feature = "gpu")]
                Kind::Card(api, index) => self.cards.open(entry.clone(), api, index)?,
                Kind::Other(backend, which) => match backend.open(which) {
                    Ok(device) => Opened::of(entry, device),
                    Err(error) => return Err(ListError { entry: entry.clone(), reason: Reason::Other(error) }),
                },
            };
            if let Some(slowed) = (speed < 1.0).then(|| Throttled::new(Arc::clone(&opened.device), speed)).flatten() {
                opened.device = Arc::new(slowed);
                #[cfg(feature = "gpu")]
                opened.card.take();
            }
            devices.push(opened);
        }
        Ok(devices)
    }

    /// Opens the devices of a list that are to work one after the other: each CPU device has all cores to itself.
    ///
    /// `auto` opens all cores as one device, and every graphics card once; software rasterisers only when named.
    ///
    /// # Errors
    /// When an entry cannot be read, or its device cannot be used.
    pub fn open_in_turn(&mut self, list: &str) -> Result<Vec<Opened>, ListError> {
        let entries = match list {
            AUTO => std::iter::once("cpu".to_owned()).chain(card_entries()).collect(),
            list => entries(list),
        };
        let mut devices = Vec::new();
        for entry in entries {
            devices.extend(self.open(&entry)?);
        }
        Ok(devices)
    }
}

fn entries(list: &str) -> Vec<String> {
    list.split(',').map(|entry| entry.trim().to_owned()).collect()
}

/// Entries for every graphics card of this machine once; software rasterisers are used only when named.
#[cfg(feature = "gpu")]
#[must_use]
pub fn card_entries() -> Vec<String> {
    cards::entries()
}

/// A build without graphics cards has none.
#[cfg(not(feature = "gpu"))]
fn card_entries() -> Vec<String> {
    Vec::new()
}

/// Whether a list can be read that names backends of this crate alone: [`Opener::check`].
///
/// # Errors
/// When an entry cannot be read.
pub fn check(list: &str) -> Result<(), ListError> {
    Opener::new().check(list)
}

/// Whether an entry of a list names a CPU device; `auto` names some.
#[must_use]
pub fn names_cpu(list: &str) -> bool {
    list == AUTO || entries(list).iter().any(|entry| parts(entry).0 == CPU)
}

/// Whether an entry of a list names a graphics card; `auto` names those that there are.
#[cfg(feature = "gpu")]
#[must_use]
pub fn names_card(list: &str) -> bool {
    list == AUTO || entries(list).iter().any(|entry| Api::ALL.iter().any(|api| api.name() == parts(entry).0))
}

/// The backend's name, what follows its colon, and the speed.
fn parts(entry: &str) -> (&str, Option<&str>, Option<&str>) {
    let (device, speed) = entry.split_once('@').map_or((entry, None), |(device, speed)| (device, Some(speed)));
    let (backend, which) = device.split_once(':').map_or((device, None), |(backend, which)| (backend, Some(which)));
    (backend, which, speed)
}

fn parse<'a>(entry: &'a str, backends: &'a [Arc<dyn Backend>]) -> Result<Spec<'a>, ListError> {
    let error = |reason| ListError { entry: entry.to_owned(), reason };
    let (backend, which, speed) = parts(entry);
    let speed = speed.map_or(Some(1.0), |speed| speed.parse::<f64>().ok());
    let is_served = |speed: &f64| (Throttled::SLOWEST..=1.0).contains(speed);
    let speed = speed.filter(is_served).ok_or_else(|| error(Reason::Speed))?;
    let kind = match own(backend, which) {
        Some(kind) => kind.map_err(error)?,
        None => match backends.iter().find(|known| known.name() == backend) {
            Some(known) => {
                known.check(which).map_err(|why| error(Reason::Other(why)))?;
                Kind::Other(&**known, which)
            }
            None => {
                let forms = backends.iter().map(|known| format!("{} ({})", known.name(), known.form()));
                return Err(error(Reason::Backend(forms.collect())));
            }
        },
    };
    Ok(Spec { kind, speed })
}

/// The device of a backend of this crate, or why it cannot be read; `None` for other backends.
fn own(backend: &str, which: Option<&str>) -> Option<Result<Kind<'static>, Reason>> {
    let number = which.map(str::parse::<usize>);
    if backend == CPU {
        return Some(match number {
            None => Ok(Kind::Cpu(0)),
            Some(Ok(threads @ 1..=MOST_THREADS)) => Ok(Kind::Cpu(threads)),
            Some(_) => Err(Reason::Threads),
        });
    }
    #[cfg(feature = "gpu")]
    if let Some(&api) = Api::ALL.iter().find(|api| api.name() == backend) {
        return Some(match number {
            Some(Ok(index)) => Ok(Kind::Card(api, index)),
            _ => Err(Reason::Index(api.name())),
        });
    }
    None
}

/// Why the devices of a list cannot be opened.
#[derive(Debug)]
pub struct ListError {
    entry: String,
    reason: Reason,
}

#[derive(Debug)]
enum Reason {
    Speed,
    Threads,
    /// The name of an API whose device has no number, or none that can be read.
    #[cfg(feature = "gpu")]
    Index(&'static str),
    /// No backend has that name; what entries of the caller's look like.
    Backend(Vec<String>),
    /// What a backend of the caller's says.
    Other(DeviceError),
    /// The API cannot be used at all, and why.
    #[cfg(feature = "gpu")]
    Api(String),
    /// The API has fewer devices.
    #[cfg(feature = "gpu")]
    Missing,
    /// The device is there and cannot be used, and why.
    #[cfg(feature = "gpu")]
    Refused(String),
    Cpu(cpu::OpenError),
}

impl From<cpu::OpenError> for ListError {
    fn from(error: cpu::OpenError) -> Self {
        Self { entry: "cpu".to_owned(), reason: Reason::Cpu(error) }
    }
}

impl fmt::Display for ListError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let entry = &self.entry;
        match &self.reason {
            Reason::Speed => {
                let slowest = Throttled::SLOWEST;
                write!(f, "the speed in `{entry}` must be a number from {slowest} to 1, such as cpu:1@0.5")
            }
            Reason::Threads => write!(
                f,
                "the thread count in `{entry}` must be a whole number from 1 to {MOST_THREADS}, such as cpu:2"
            ),
            #[cfg(feature = "gpu")]
            Reason::Index(api) => write!(f, "`{entry}` needs a device's number, such as {api}:0"),
            Reason::Backend(others) => {
                write!(f, "`{entry}` names no backend of this build; there are: cpu (cpu:THREADS)")?;
                #[cfg(feature = "gpu")]
                Api::ALL.iter().map(|api| api.name()).try_for_each(|name| write!(f, ", {name} ({name}:N)"))?;
                others.iter().try_for_each(|form| write!(f, ", {form}"))
            }
            Reason::Other(error) => write!(f, "`{entry}`: {error}"),
            #[cfg(feature = "gpu")]
            Reason::Api(why) => f.write_str(why),
            #[cfg(feature = "gpu")]
            Reason::Missing => write!(f, "there is no {entry}; `raybalance devices` lists what there is"),
            #[cfg(feature = "gpu")]
            Reason::Refused(why) => write!(f, "{entry} cannot be used: {why}"),
            Reason::Cpu(error) => error.fmt(f),
        }
    }
}

impl Error for ListError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match &self.reason {
            Reason::Cpu(error) => error.source(),
            Reason::Other(error) => error.source(),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::DeviceErrorKind;

    /// Mutants: a bound of the speeds or of the threads moved; `check` that looks at the first entry alone.
    #[test]
    fn entries_are_parsed_or_explained() {
        assert!(matches!(parse("cpu", &[]), Ok(Spec { kind: Kind::Cpu(0), speed: 1.0 })));
        assert!(matches!(parse("cpu:3@0.5", &[]), Ok(Spec { kind: Kind::Cpu(3), speed: 0.5 })));
        for bad in [
            "",
            "gpu",
            "cuda:0",
            "cpu:0",
            "cpu:4097",
            "cpu:x",
            "cpu:-1",
            "cpu:1@",
            "cpu:1@0",
            "cpu:1@-1",
            "cpu:1@nan",
            "cpu:1@inf",
            "cpu:1@2",
            "cpu:1@1.01",
            "cpu:1@1e-300",
            "cpu:1@1e-6",
            "cpu:1@0.0009",
            "cpu:1@0.5@0.5",
            "vulkan",
            "vulkan:x",
            "wgpu",
            "wgpu:-1",
        ] {
            let message = parse(bad, &[]).unwrap_err().to_string();
            assert!(message.contains(&format!("`{bad}`")), "{message}");
            assert!(check(&format!("cpu:1, {bad}")).is_err(), "{bad}");
        }
        assert!(["auto", "cpu", "cpu:1,cpu:4096@0.001"].iter().all(|list| check(list).is_ok()));
        // Not a list of its own beside other entries.
        assert!(check("cpu:1,auto").is_err());
    }

    /// Mutants: the first entry looked at alone; `auto` taken for an entry; a name that begins as another taken for it.
    #[cfg(all(feature = "vulkan", feature = "wgpu"))]
    #[test]
    fn lists_tell_what_they_name() {
        for (list, cpu, card) in [
            ("auto", true, true),
            ("cpu:1, cpu@0.5", true, false),
            ("vulkan:0", false, true),
            ("cpu:1,wgpu:0", true, true),
            ("cpux:1,other", false, false),
        ] {
            assert_eq!((names_cpu(list), names_card(list)), (cpu, card), "{list}");
        }
    }

    /// Mutant: entries read as they stand, with the blanks around them.
    #[test]
    fn a_list_is_opened_in_its_order() {
        let opened = Opener::new().open("cpu:1, cpu:1@0.5").unwrap();
        assert_eq!(opened.iter().map(|o| o.entry.as_str()).collect::<Vec<_>>(), ["cpu:1", "cpu:1@0.5"]);
        assert!(!opened[0].device.info().name.contains("speed") && opened[1].device.info().name.contains("speed 0.5"));
        assert_eq!(Opener::new().open_in_turn("cpu:1,cpu:1").unwrap().len(), 2);
    }

    #[cfg(all(feature = "vulkan", feature = "wgpu"))]
    #[test]
    fn cards_are_named_by_api_and_number() {
        assert!(matches!(parse("vulkan:2", &[]), Ok(Spec { kind: Kind::Card(Api::Vulkan, 2), speed: 1.0 })));
        assert!(matches!(parse("wgpu:1@0.5", &[]), Ok(Spec { kind: Kind::Card(Api::Wgpu, 1), speed: 0.5 })));
    }

    /// Opens CPU devices under other names; those of others than one thread cannot be read.
    #[derive(Debug)]
    struct Renamed(&'static str);

    impl Backend for Renamed {
        fn name(&self) -> &str {
            self.0
        }

        fn form(&self) -> &str {
            "other:1"
        }

        fn check(&self, which: Option<&str>) -> Result<(), DeviceError> {
            let refused = || DeviceError::new(DeviceErrorKind::InvalidArgument, "say 1 or 2");
            which.filter(|which| ["1", "2"].contains(which)).map(drop).ok_or_else(refused)
        }

        fn open(&self, which: Option<&str>) -> Result<Arc<dyn Device>, DeviceError> {
            match which {
                Some("1") => Ok(Arc::new(CpuDevice::open_all(&[1]).unwrap().remove(0))),
                _ => Err(DeviceError::new(DeviceErrorKind::Unsupported, "not today")),
            }
        }
    }

    /// Mutants: a caller's backend asked for ours; its order, speed, refusal or form lost; asked without its colon.
    #[test]
    fn lists_name_a_callers_own_backends() {
        let backends = || ["other", "cpu"].map(|name| Arc::new(Renamed(name)) as Arc<dyn Backend>);
        let opener = || Opener::new().with_backends(backends());
        let opened = opener().open("other:1@0.5,cpu,other:1").unwrap();
        assert_eq!(opened.iter().map(|o| o.entry.as_str()).collect::<Vec<_>>(), ["other:1@0.5", "cpu", "other:1"]);
        assert!(opened[0].device.info().name.contains("speed 0.5"));
        // Ours of that name reads more.
        assert!(opener().check("other:2,cpu:3,cpu").is_ok());
        let error = |list: &str| opener().check(list).unwrap_err().to_string();
        assert_eq!(error("cpu,other:7"), "`other:7`: say 1 or 2");
        assert_eq!(error("other"), "`other`: say 1 or 2");
        assert!(error("another:1").ends_with(", other (other:1), cpu (other:1)"), "{}", error("another:1"));
        assert_eq!(opener().open("other:2").unwrap_err().to_string(), "`other:2`: not today");
        assert!(check("other:1").is_err());
    }
}
