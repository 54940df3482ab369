//! The Vulkan instance, and the validation layer's messages.

use crate::error::{OpenError, VALIDATION, opening};
use ash::vk;
use rt_shaders::FloatControls;
use std::borrow::Cow;
use std::ffi::{CStr, CString, c_char, c_void};
use std::fmt;
use std::sync::{Mutex, PoisonError};

/// The version of Vulkan that we need, for timeline semaphores.
const API: u32 = vk::API_VERSION_1_2;

/// What a driver says of a device, as far as it decides whether we use it.
#[derive(Clone, Debug)]
pub(crate) struct Description {
    pub name: String,
    /// The driver's name, and its version in its own words.
    pub driver: String,
    pub version: String,
    /// Whether it is Mesa's software rasteriser.
    pub is_llvmpipe: bool,
    /// Whether it is a processor.
    pub is_software: bool,
    /// PCI's numbers of its maker and its model, and where it sits.
    pub model: [u32; 2],
    pub slot: Option<String>,
    /// Whether it knows the version of Vulkan that we need.
    pub has_api: bool,
    pub has_timelines: bool,
    /// Greatest number of storage buffers that a kernel may use.
    pub buffers: u32,
}

/// What a device can do that we use where it is there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Abilities {
    pub float_controls: FloatControls,
    /// Whether the driver says how much memory other programs leave.
    pub knows_budget: bool,
}

/// Messages of the validation layer. Behind a pointer that the driver holds, hence never moved.
#[derive(Debug, Default)]
struct Messages(Mutex<Vec<String>>);

/// An instance and its loader. Destroyed last: whatever is made from it holds it.
pub(crate) struct Instance {
    // Dropped after `raw`'s functions were last called: it keeps the loader's library in memory.
    _entry: ash::Entry,
    raw: ash::Instance,
    validation: Option<Validation>,
}

struct Validation {
    functions: ash::ext::debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
    messages: Box<Messages>,
}

impl fmt::Debug for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Instance").field("validation", &self.validation.is_some()).finish_non_exhaustive()
    }
}

impl Instance {
    /// Loads Vulkan; with `validate` also its validation layer, synchronisation included.
    pub(crate) fn new(validate: bool) -> Result<Self, OpenError> {
        // SAFETY: the system's Vulkan loader is trusted to be one.
        let entry = unsafe { ash::Entry::load() }.map_err(OpenError::NoLoader)?;
        let layer = CString::new(VALIDATION).unwrap_or_default();
        if validate && !has_layer(&entry, &layer)? {
            return Err(OpenError::NoValidation);
        }
        let layers: Vec<_> = validate.then_some(layer.as_ptr()).into_iter().collect();
        let extensions = if validate { layer_extensions(&entry, &layer)? } else { Vec::new() };
        let application = vk::ApplicationInfo::default().application_name(c"raybalance").api_version(API);
        let wanted = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        // A file below the home folder, which every device reads and writes beside all others.
        let unwanted = [vk::ValidationFeatureDisableEXT::SHADER_VALIDATION_CACHE];
        let mut features = vk::ValidationFeaturesEXT::default()
            .enabled_validation_features(&wanted)
            .disabled_validation_features(&unwanted);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        if validate {
            info = info.push_next(&mut features);
        }
        // SAFETY: `info` and all it points to live until the call returns.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|source| match source {
            // What loaders without any driver say.
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => OpenError::NoDevice,
            source => OpenError::Driver { task: "create an instance", source },
        })?;
        let mut instance = Self { _entry: entry, raw, validation: None };
        if validate {
            let functions = ash::ext::debug_utils::Instance::new(&instance._entry, &instance.raw);
            instance.validation = Some(Validation::new(functions)?);
        }
        Ok(instance)
    }

    pub(crate) const fn raw(&self) -> &ash::Instance {
        &self.raw
    }

    /// The system's devices, in its order.
    pub(crate) fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>, OpenError> {
        // SAFETY: the instance is alive.
        unsafe { self.raw.enumerate_physical_devices() }.map_err(opening("list its devices"))
    }

    /// What the driver says of a device of this instance.
    pub(crate) fn describe(&self, physical: vk::PhysicalDevice) -> Description {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut place = vk::PhysicalDevicePCIBusInfoPropertiesEXT::default();
        // SAFETY: the instance is alive, and `physical` is of it.
        let extensions = unsafe { self.raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
        let tells_place = extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::ext::pci_bus_info::NAME));
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        if tells_place {
            properties = properties.push_next(&mut place);
        }
        // SAFETY: `physical` is of this instance, and the structures are those that the call fills.
        unsafe { self.raw.get_physical_device_properties2(physical, &mut properties) };
        let properties = properties.properties;
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default();
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut timeline);
        // SAFETY: `physical` is of this instance, and the structures are those that the call fills.
        unsafe { self.raw.get_physical_device_features2(physical, &mut features) };
        let text = |text: Option<&CStr>| text.map_or_else(String::new, |t| t.to_string_lossy().into_owned());
        Description {
            name: text(properties.device_name_as_c_str().ok()),
            driver: text(driver.driver_name_as_c_str().ok()),
            version: text(driver.driver_info_as_c_str().ok()),
            is_llvmpipe: driver.driver_id == vk::DriverId::MESA_LLVMPIPE,
            is_software: properties.device_type == vk::PhysicalDeviceType::CPU,
            model: [properties.vendor_id, properties.device_id],
            slot: tells_place.then(|| {
                let [domain, bus] = [place.pci_domain, place.pci_bus];
                format!("{domain:04x}:{bus:02x}:{:02x}.{:x}", place.pci_device, place.pci_function)
            }),
            has_api: properties.api_version >= API,
            has_timelines: timeline.timeline_semaphore == vk::TRUE,
            buffers: properties.limits.max_per_stage_descriptor_storage_buffers,
        }
    }

    /// What a device of this instance, which knows our version of Vulkan, can do beyond what we need.
    pub(crate) fn abilities(&self, physical: vk::PhysicalDevice) -> Result<Abilities, OpenError> {
        let mut controls = vk::PhysicalDeviceFloatControlsProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut controls);
        // SAFETY: `physical` is of this instance, and the structures are those that the call fills.
        unsafe { self.raw.get_physical_device_properties2(physical, &mut properties) };
        // SAFETY: `physical` is of this instance.
        let extensions = unsafe { self.raw.enumerate_device_extension_properties(physical) };
        let extensions = extensions.map_err(opening("list a device's extensions"))?;
        Ok(Abilities {
            float_controls: FloatControls {
                signed_zero_inf_nan: controls.shader_signed_zero_inf_nan_preserve_float32 == vk::TRUE,
                denormals: controls.shader_denorm_preserve_float32 == vk::TRUE,
                round_to_nearest: controls.shader_rounding_mode_rte_float32 == vk::TRUE,
            },
            knows_budget: has_extension(&extensions, ash::ext::memory_budget::NAME),
        })
    }

    /// What the validation layer said since the last call.
    pub(crate) fn take_messages(&self) -> Vec<String> {
        self.validation.as_ref().map_or_else(Vec::new, |validation| {
            std::mem::take(&mut *validation.messages.0.lock().unwrap_or_else(PoisonError::into_inner))
        })
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some(Validation { functions, messenger, .. }) = &self.validation {
            // SAFETY: made from this instance, and not used after.
            unsafe { functions.destroy_debug_utils_messenger(*messenger, None) };
        }
        // SAFETY: everything made from the instance held it and is gone.
        unsafe { self.raw.destroy_instance(None) };
    }
}

/// The extensions that we use of the validation layer: to hear it, and to choose what it looks at. Without the latter
/// it is left to its own choice, which tests find out.
fn layer_extensions(entry: &ash::Entry, layer: &CStr) -> Result<Vec<*const c_char>, OpenError> {
    // SAFETY: the loader is loaded and has the layer.
    let found = unsafe { entry.enumerate_instance_extension_properties(Some(layer)) };
    let found = found.map_err(opening("list its layer's extensions"))?;
    let choice = ash::ext::validation_features::NAME;
    let choice = has_extension(&found, choice).then_some(choice.as_ptr());
    Ok(std::iter::once(ash::ext::debug_utils::NAME.as_ptr()).chain(choice).collect())
}

fn has_extension(list: &[vk::ExtensionProperties], wanted: &CStr) -> bool {
    list.iter().any(|extension| extension.extension_name_as_c_str() == Ok(wanted))
}

fn has_layer(entry: &ash::Entry, wanted: &CStr) -> Result<bool, OpenError> {
    // SAFETY: the loader is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.map_err(opening("list its layers"))?;
    Ok(layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(wanted)))
}

impl Validation {
    fn new(functions: ash::ext::debug_utils::Instance) -> Result<Self, OpenError> {
        let messages = Box::<Messages>::default();
        let pointer: *const Messages = &*messages;
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(receive))
            .user_data(pointer.cast::<c_void>().cast_mut());
        // SAFETY: `info` lives until the call returns; `messages` is boxed and outlives the messenger, which `Instance`
        // destroys first.
        let messenger = unsafe { functions.create_debug_utils_messenger(&info, None) };
        Ok(Self { functions, messenger: messenger.map_err(opening("listen to the validation layer"))?, messages })
    }
}

/// Keeps a message. Called by the layer on whatever thread made the call that it speaks of.
///
/// # Safety
/// `data` is null or valid during the call, `user` null or the messenger's own `Messages`.
unsafe extern "system" fn receive(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the pointer given with the messenger, to `Messages` that outlive it; never written through.
    let messages = unsafe { user.cast::<Messages>().cast_const().as_ref() };
    // SAFETY: the layer passes a valid structure or null.
    let data = unsafe { data.as_ref() };
    if let (Some(messages), Some(data)) = (messages, data) {
        // SAFETY: the message, where there is one, is a string that outlives this call.
        let text = unsafe { data.message_as_c_str() }.map_or(Cow::Borrowed("(no text)"), CStr::to_string_lossy);
        messages.0.lock().unwrap_or_else(PoisonError::into_inner).push(text.into_owned());
    }
    vk::FALSE
}
