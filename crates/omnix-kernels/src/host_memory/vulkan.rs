//! Importing memory into a software Vulkan device, through the handles beneath wgpu. The only code here that calls the driver itself.

#![expect(unsafe_code, reason = "wgpu has no safe way to import memory")]

use ash::{ext::external_memory_host, vk};
use wgpu::hal::{api::Vulkan, vulkan};

use super::{HostMemory, PAGE};
use crate::dispatch::round_up;

const HANDLE: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::HOST_ALLOCATION_EXT;

/// Opens a software Vulkan `adapter` so that it imports memory; `None` for any other and where the driver cannot.
pub(crate) fn open(
    adapter: &wgpu::Adapter,
    descriptor: &wgpu::DeviceDescriptor<'_>,
) -> Option<Result<(wgpu::Device, wgpu::Queue), wgpu::RequestDeviceError>> {
    if adapter.get_info().device_type != wgpu::DeviceType::Cpu {
        return None;
    }
    // SAFETY: the handle is not destroyed.
    let hal = unsafe { adapter.as_hal::<Vulkan>() }?;
    if !hal.physical_device_capabilities().supports_extension(external_memory_host::NAME) {
        return None;
    }
    let extend = |args: vulkan::CreateDeviceCallbackArgs<'_, '_, '_>| args.extensions.push(external_memory_host::NAME);
    // SAFETY: `wgpu::Adapter::request_device` makes the same call, without the callback, which adds an extension of the adapter to the
    // list meant for that. What the extension depends on is core in Vulkan 1.1.
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

/// Whether [`import`] is to be had: the device is in software, opened with the extension, and content with our alignment.
pub(crate) fn imports(device: &wgpu::Device) -> bool {
    // SAFETY: the handle is not destroyed.
    let Some(hal) = (unsafe { device.as_hal::<Vulkan>() }) else { return false };
    let instance = hal.shared_instance();
    if device.adapter_info().device_type != wgpu::DeviceType::Cpu
        || instance.instance_api_version() < vk::API_VERSION_1_1
        || !hal.enabled_device_extensions().contains(&external_memory_host::NAME)
    {
        return false;
    }
    let mut asked = vk::PhysicalDeviceExternalMemoryHostPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut asked);
    // SAFETY: a function of Vulkan 1.1; the physical device is the instance's.
    unsafe { instance.raw_instance().get_physical_device_properties2(hal.raw_physical_device(), &mut properties) };
    asked.min_imported_host_pointer_alignment <= PAGE
}

/// A buffer in `memory`, which lives as long; `None` where the driver refuses. Asks for [`imports`].
pub(crate) fn import(
    device: &wgpu::Device,
    label: &str,
    memory: HostMemory,
    usage: wgpu::BufferUsages,
) -> Option<wgpu::Buffer> {
    let size = memory.bytes as u64;
    // SAFETY: the handle is not destroyed.
    let hal = unsafe { device.as_hal::<Vulkan>() }?;
    let imported = Imported::new(&hal, memory, usage)?;
    let (buffer, release) = (imported.buffer, Box::new(move || drop(imported)));
    // SAFETY: `release` destroys it, and wgpu calls that when it has no more use for it.
    let buffer = unsafe { vulkan::Buffer::from_raw_externally_owned(buffer, release) };
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
    // SAFETY: made from this device by this descriptor, of at least a byte, and all of its bytes have a value.
    Some(unsafe { device.create_buffer_from_hal::<Vulkan>(buffer, &descriptor) })
}

/// What an imported buffer consists of.
struct Imported {
    device: ash::Device,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    host: HostMemory,
}

impl Imported {
    fn new(hal: &vulkan::Device, host: HostMemory, usage: wgpu::BufferUsages) -> Option<Self> {
        let (size, length) = (host.bytes as u64, round_up(host.bytes as u64, PAGE));
        let (buffer, memory) = (vk::Buffer::null(), vk::DeviceMemory::null());
        let mut made = Self { device: hal.raw_device().clone(), buffer, memory, host };
        let device = &made.device;

        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(HANDLE);
        let info = vk::BufferCreateInfo::default().size(size).usage(usages(usage)).push_next(&mut external);
        // SAFETY: the device is alive while `hal` is; the info is valid for a size above 0 and a known usage.
        made.buffer = unsafe { device.create_buffer(&info, None) }.ok()?;
        // SAFETY: it was made above.
        let needed = unsafe { device.get_buffer_memory_requirements(made.buffer) };

        let start = made.host.as_mut_ptr().cast();
        let loader = external_memory_host::Device::new(hal.shared_instance().raw_instance(), device);
        let properties = loader.fp().get_memory_host_pointer_properties_ext;
        let mut can = vk::MemoryHostPointerPropertiesEXT::default();
        // SAFETY: the device was opened with the extension (`imports`); `start` is mapped, at a multiple of a huge page.
        unsafe { properties(device.handle(), HANDLE, start, &mut can) }.result().ok()?;
        let types = needed.memory_type_bits & can.memory_type_bits;
        if types == 0 || needed.size > length {
            return None;
        }

        let mut pointer = vk::ImportMemoryHostPointerInfoEXT::default().handle_type(HANDLE).host_pointer(start);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(length)
            .memory_type_index(types.trailing_zeros())
            .push_next(&mut pointer);
        // SAFETY: `length` bytes from `start` on are mapped until `host` goes, which is after what is allocated here.
        made.memory = unsafe { device.allocate_memory(&info, None) }.ok()?;
        // SAFETY: both are of this device and not bound yet, and type and size are what the buffer asks for.
        unsafe { device.bind_buffer_memory(made.buffer, made.memory, 0) }.ok()?;
        Some(made)
    }
}

impl Drop for Imported {
    fn drop(&mut self) {
        // SAFETY: nothing uses them: either wgpu has let go of the buffer, which it does before the device goes, or it never had it.
        // Null handles are left alone.
        unsafe {
            self.device.destroy_buffer(self.buffer, None);
            self.device.free_memory(self.memory, None);
        }
    }
}

fn usages(usage: wgpu::BufferUsages) -> vk::BufferUsageFlags {
    let flags = [
        (wgpu::BufferUsages::STORAGE, vk::BufferUsageFlags::STORAGE_BUFFER),
        (wgpu::BufferUsages::UNIFORM, vk::BufferUsageFlags::UNIFORM_BUFFER),
        (wgpu::BufferUsages::COPY_SRC, vk::BufferUsageFlags::TRANSFER_SRC),
        (wgpu::BufferUsages::COPY_DST, vk::BufferUsageFlags::TRANSFER_DST),
    ];
    let wanted = flags.into_iter().filter(|(one, _)| usage.contains(*one));
    wanted.fold(vk::BufferUsageFlags::empty(), |all, (_, flag)| all | flag)
}
