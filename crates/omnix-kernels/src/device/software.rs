//! Why a run is on a software device, in words for a person.
//!
//! wgpu lists the adapters that drivers offer, and is silent about a GPU that is in the machine but that no usable driver offers. Its
//! device files tell: Linux has one for every graphics card, WSL2 has `/dev/dxg`.

use std::path::Path;

use crate::adapter;

/// Device files of GPUs under Linux.
const NODES: [&str; 3] = ["/dev/nvidia0", "/dev/kfd", "/dev/dri/renderD128"];
/// The GPU of the Windows host, as WSL2 shows it.
const WSL: &str = "/dev/dxg";
/// What the Vulkan loader takes its list of drivers from instead of the system's folders.
const LISTS: [&str; 3] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "VK_LOADER_DRIVERS_SELECT"];

/// What there is beside the adapter in use.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Surroundings {
    /// The host named the device.
    asked: bool,
    /// GPUs that the list has, with what keeps each from being used.
    unusable: Vec<(String, String)>,
    /// Whether a GPU of the list could be used.
    usable: bool,
    /// An environment variable that limits the Vulkan drivers, and its value.
    limited: Option<(String, String)>,
    /// Whether this is WSL2 with a GPU.
    wsl: bool,
    /// A device file of a GPU.
    node: Option<&'static str>,
}

/// Why `info`, an adapter in use that `wanted` may have named, is a software device; `None` where it is a GPU. Lists the adapters
/// once more.
#[must_use]
pub fn why_software(info: &wgpu::AdapterInfo, wanted: Option<&str>) -> Option<String> {
    if info.device_type != wgpu::DeviceType::Cpu {
        return None;
    }
    let mut around = Surroundings {
        asked: wanted.is_some(),
        limited: LISTS.iter().find_map(|name| Some(((*name).to_owned(), std::env::var(name).ok()?))),
        wsl: Path::new(WSL).exists(),
        node: NODES.into_iter().find(|node| Path::new(node).exists()),
        ..Surroundings::default()
    };
    for adapter in adapter::enumerate() {
        let info = adapter.get_info();
        if info.device_type != wgpu::DeviceType::Cpu {
            match adapter::shortcomings(&adapter).join("; ") {
                reasons if reasons.is_empty() => around.usable = true,
                reasons => around.unusable.push((info.name, reasons)),
            }
        }
    }
    Some(around.reason())
}

impl Surroundings {
    fn reason(&self) -> String {
        if let Some((name, reasons)) = self.unusable.first().filter(|_| !self.usable) {
            return format!("{name} is too small for the kernels: {reasons}");
        }
        if self.usable {
            return if self.asked { "it was asked for" } else { "the GPU was not taken" }.to_owned();
        }
        if let Some((name, value)) = &self.limited {
            return format!("no GPU adapter was found; {name} limits the Vulkan drivers to {value}");
        }
        if self.wsl {
            return format!(
                "no GPU adapter was found; under WSL2 ({WSL}) Vulkan has the GPU only through Mesa's dozen driver, which wgpu \
                 leaves out because it does not conform: run the Windows build for the GPU"
            );
        }
        if let Some(node) = self.node {
            return format!("no GPU adapter was found, although there is {node}: no Vulkan driver for it is installed");
        }
        "no GPU adapter was found".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::Surroundings;

    #[test]
    fn the_nearest_reason_is_told() {
        let nothing = Surroundings::default();
        assert_eq!(nothing.reason(), "no GPU adapter was found");
        let with_card = Surroundings { node: Some("/dev/nvidia0"), ..nothing.clone() };
        assert!(with_card.reason().contains("although there is /dev/nvidia0"), "{}", with_card.reason());
        let wsl = Surroundings { wsl: true, ..nothing.clone() };
        assert!(wsl.reason().contains("WSL2") && wsl.reason().contains("dozen"), "{}", wsl.reason());
        let list = ("VK_DRIVER_FILES".to_owned(), "lvp.json".to_owned());
        let limited = Surroundings { limited: Some(list), ..wsl.clone() };
        assert!(limited.reason().contains("VK_DRIVER_FILES limits the Vulkan drivers to lvp.json"));
        let small = ("Tiny GPU".to_owned(), "workgroup memory is 8, at least 16 is needed".to_owned());
        let unusable = Surroundings { unusable: vec![small], ..limited.clone() };
        assert!(unusable.reason().starts_with("Tiny GPU is too small for the kernels: workgroup memory is 8"));
        let asked = Surroundings { asked: true, usable: true, ..unusable };
        assert_eq!(asked.reason(), "it was asked for");
    }
}
