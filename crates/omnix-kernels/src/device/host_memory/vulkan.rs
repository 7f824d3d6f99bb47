//! Importing memory into a software Vulkan device, through the handles beneath wgpu. The only code here that calls the driver itself.

#![expect(unsafe_code, reason = "wgpu has no safe way to import memory")]

use ash::{ext::external_memory_host, vk};
use wgpu::hal::{api::Vulkan, vulkan};

use super::memory::{HostMemory, PAGE};
use crate::dispatch::round_up;

const HANDLE: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::HOST_ALLOCATION_EXT;

/// What imported buffers can be used for.
const USAGES: [(wgpu::BufferUsages, vk::BufferUsageFlags); 4] = [
    (wgpu::BufferUsages::STORAGE, vk::BufferUsageFlags::STORAGE_BUFFER),
    (wgpu::BufferUsages::UNIFORM, vk::BufferUsageFlags::UNIFORM_BUFFER),
    (wgpu::BufferUsages::COPY_SRC, vk::BufferUsageFlags::TRANSFER_SRC),
    (wgpu::BufferUsages::COPY_DST, vk::BufferUsageFlags::TRANSFER_DST),
];

/// Opens a software Vulkan `adapter` so that it imports memory; `None` for any other and where the driver cannot. The features and
/// limits of `descriptor` are the adapter's: unlike [`wgpu::Adapter::request_device`] this does not check them.
pub(crate) fn open(
    adapter: &wgpu::Adapter,
    descriptor: &wgpu::DeviceDescriptor<'_>,
) -> Option<Result<(wgpu::Device, wgpu::Queue), wgpu::RequestDeviceError>> {
    if adapter.get_info().device_type != wgpu::DeviceType::Cpu {
        return None;
    }
    // SAFETY: the handle is not destroyed.
    let hal = unsafe { adapter.as_hal::<Vulkan>() }?;
    if !hal.physical_device_capabilities().supports_extension(external_memory_host::NAME)
        || !importable(hal.shared_instance(), hal.raw_physical_device())
    {
        return None;
    }
    let extend = |args: vulkan::CreateDeviceCallbackArgs<'_, '_, '_>| args.extensions.push(external_memory_host::NAME);
    // SAFETY: wgpu makes the same call, without the callback, which adds an extension of the adapter to the list meant for that. What
    // the extension depends on is core in the Vulkan that `importable` asks for.
    let opened = unsafe {
        hal.open_with_callback(
            descriptor.required_features,
            &descriptor.required_limits,
            &descriptor.memory_hints,
            Some(Box::new(extend)),
        )
    };
    // SAFETY: opened from this adapter with the features of the descriptor.
    Some(unsafe { adapter.create_device_from_hal(opened.ok()?, descriptor) })
}

/// Whether [`import`] is to be had: a software device, opened with the extension.
pub(crate) fn imports(device: &wgpu::Device) -> bool {
    // SAFETY: the handle is not destroyed.
    let Some(hal) = (unsafe { device.as_hal::<Vulkan>() }) else { return false };
    device.adapter_info().device_type == wgpu::DeviceType::Cpu
        && hal.enabled_device_extensions().contains(&external_memory_host::NAME)
        && importable(hal.shared_instance(), hal.raw_physical_device())
}

/// Whether a device knows Vulkan 1.1 and imports buffers at the alignment of [`HostMemory`].
fn importable(instance: &vulkan::InstanceShared, device: vk::PhysicalDevice) -> bool {
    let raw = instance.raw_instance();
    // SAFETY: the physical device is the instance's.
    let known = unsafe { raw.get_physical_device_properties(device) }.api_version;
    if instance.instance_api_version().min(known) < vk::API_VERSION_1_1 {
        return false;
    }
    let mut host = vk::PhysicalDeviceExternalMemoryHostPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut host);
    let all = USAGES.iter().fold(vk::BufferUsageFlags::empty(), |all, (_, flag)| all | *flag);
    let info = vk::PhysicalDeviceExternalBufferInfo::default().usage(all).handle_type(HANDLE);
    let mut external = vk::ExternalBufferProperties::default();
    // SAFETY: functions of Vulkan 1.1, which instance and device know.
    unsafe {
        raw.get_physical_device_properties2(device, &mut properties);
        raw.get_physical_device_external_buffer_properties(device, &info, &mut external);
    }
    let can = external.external_memory_properties.external_memory_features;
    host.min_imported_host_pointer_alignment <= PAGE
        && can.contains(vk::ExternalMemoryFeatureFlags::IMPORTABLE)
        && !can.contains(vk::ExternalMemoryFeatureFlags::DEDICATED_ONLY)
}

/// A buffer in `memory`, which lives as long; the memory back where `usage` is not for imports or the driver refuses. Asks for
/// [`imports`].
pub(crate) fn import(
    device: &wgpu::Device,
    label: &str,
    mut memory: HostMemory,
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, HostMemory> {
    let known = USAGES.iter().fold(wgpu::BufferUsages::empty(), |all, (one, _)| all | *one);
    // SAFETY: the handle is not destroyed.
    let hal = unsafe { device.as_hal::<Vulkan>() };
    let Some(hal) = hal.filter(|_| !memory.is_empty() && !usage.is_empty() && known.contains(usage)) else {
        return Err(memory);
    };
    let size = memory.len() as u64;
    let handles = match Handles::new(&hal, &mut memory, usage) {
        Ok(handles) => handles,
        Err(refusal) => {
            tracing::warn!(%refusal, size, "the driver does not import memory");
            return Err(memory);
        }
    };
    let buffer = handles.buffer;
    let release = Box::new(move || {
        drop(handles);
        drop(memory);
    });
    // SAFETY: `release` destroys it, and wgpu calls that when it has no more use for it.
    let buffer = unsafe { vulkan::Buffer::from_raw_externally_owned(buffer, release) };
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
    // SAFETY: made from this device by this descriptor, of at least a byte, and all of its bytes have a value.
    Ok(unsafe { device.create_buffer_from_hal::<Vulkan>(buffer, &descriptor) })
}

/// What the driver has of an imported buffer. Goes before the memory.
struct Handles {
    device: ash::Device,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
}

impl Handles {
    fn new(hal: &vulkan::Device, host: &mut HostMemory, usage: wgpu::BufferUsages) -> Result<Self, vk::Result> {
        let (size, length) = (host.len() as u64, round_up(host.len() as u64, PAGE));
        let (buffer, memory) = (vk::Buffer::null(), vk::DeviceMemory::null());
        let mut made = Self { device: hal.raw_device().clone(), buffer, memory };
        let (device, instance) = (&made.device, hal.shared_instance().raw_instance());

        let flags = USAGES.iter().filter(|(one, _)| usage.contains(*one));
        let flags = flags.fold(vk::BufferUsageFlags::empty(), |all, (_, flag)| all | *flag);
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(HANDLE);
        let info = vk::BufferCreateInfo::default().size(size).usage(flags).push_next(&mut external);
        // SAFETY: the device is alive while `hal` is; the size is above 0, and `importable` has asked for the usage.
        made.buffer = unsafe { device.create_buffer(&info, None) }?;
        // SAFETY: it was made above.
        let needed = unsafe { device.get_buffer_memory_requirements(made.buffer) };

        let start = host.as_mut_ptr().cast();
        let properties =
            external_memory_host::Device::new(instance, device).fp().get_memory_host_pointer_properties_ext;
        let mut can = vk::MemoryHostPointerPropertiesEXT::default();
        // SAFETY: the device was opened with the extension (`imports`); `start` is mapped, at a multiple of a huge page.
        unsafe { properties(device.handle(), HANDLE, start, &mut can) }.result()?;
        // SAFETY: the physical device is the instance's.
        let known = unsafe { instance.get_physical_device_memory_properties(hal.raw_physical_device()) };
        // Only in such types what the program has written is there and seen.
        let seen = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let fits = |(i, one): &(usize, &vk::MemoryType)| {
            (needed.memory_type_bits & can.memory_type_bits) >> i & 1 == 1 && one.property_flags.contains(seen)
        };
        let (index, _) = known
            .memory_types_as_slice()
            .iter()
            .enumerate()
            .find(fits)
            .filter(|_| needed.size <= length)
            .ok_or(vk::Result::ERROR_INVALID_EXTERNAL_HANDLE)?;

        let mut pointer = vk::ImportMemoryHostPointerInfoEXT::default().handle_type(HANDLE).host_pointer(start);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(length)
            .memory_type_index(index as u32)
            .push_next(&mut pointer);
        // SAFETY: `length` bytes from `start` on are mapped until after `made` is dropped.
        made.memory = unsafe { device.allocate_memory(&info, None) }?;
        // SAFETY: both are of this device and not bound yet, and type and size are what the buffer asks for.
        unsafe { device.bind_buffer_memory(made.buffer, made.memory, 0) }?;
        Ok(made)
    }
}

impl Drop for Handles {
    fn drop(&mut self) {
        // SAFETY: nothing uses them: either wgpu has let go of the buffer, which it does before the device goes, or it never had it.
        // Null handles are left alone.
        unsafe {
            self.device.destroy_buffer(self.buffer, None);
            self.device.free_memory(self.memory, None);
        }
    }
}
