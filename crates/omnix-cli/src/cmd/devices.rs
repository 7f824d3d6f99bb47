//! `omnix devices`: every adapter, what it is, what it lacks, and what follows from that.

use clap::Args;
use omnix::Caps;
use omnix::kernels::{Cooperative, KernelError, adapter, why_software};
use omnix::wgpu::{Adapter, Features};
use serde_json::{Value, json};

use crate::bytes;
use crate::error::CliError;
use crate::ui::{self, Ui};

/// Arguments of `omnix devices`.
#[derive(Debug, Args)]
pub(crate) struct DevicesArgs {
    /// One JSON object on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Prints the list. No device at all is an error.
pub(crate) fn run(_args: &DevicesArgs, ui: &mut Ui) -> Result<(), CliError> {
    let adapters = adapter::enumerate();
    let facts: Vec<Value> = adapters.iter().enumerate().map(|(i, a)| describe(i, a)).collect();
    let chosen = facts.iter().position(|f| f["usable"] == true);
    let software = chosen.and_then(|index| why_software(&adapters[index].get_info(), None));
    if ui.json() {
        ui.event("devices", json!({ "devices": facts, "default": chosen, "software": software }));
    } else {
        for fact in &facts {
            ui::print(&text(fact, chosen))?;
        }
        if let Some(why) = &software {
            ui::print(&format!("The default is a software device: {why}."))?;
        }
    }
    if facts.is_empty() {
        let reason = "this machine offers no Vulkan, Metal or DX12 device (is a driver installed, and does VK_DRIVER_FILES or \
                      VK_ICD_FILENAMES hide it?)";
        return Err(KernelError::NoAdapter { reason: reason.to_owned() }.into());
    }
    if chosen.is_none() {
        return Err(KernelError::NoAdapter { reason: "none of the devices above will do".to_owned() }.into());
    }
    Ok(())
}

/// Why a feature is wanted.
fn purpose(feature: Features) -> &'static str {
    if feature == Features::SUBGROUP {
        "faster reductions, and the software device's fast kernels"
    } else if feature == Features::TIMESTAMP_QUERY {
        "times of single kernels in bench --trace"
    } else if feature == Features::SHADER_F16 {
        "GPU kernels that compute with f16 beside f16 and int8 weights"
    } else if feature == Features::SHADER_INT64 {
        "the software device's fast kernels, which read 64 bits at a time"
    } else {
        "speed"
    }
}

fn describe(index: usize, adapter: &Adapter) -> Value {
    let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
    let mut reasons = adapter::shortcomings(adapter);
    let mut tier = Value::Null;
    if reasons.is_empty() {
        match adapter::open(adapter) {
            Ok((device, _queue)) => tier = Caps::of(&device).tier.to_string().into(),
            Err(error) => reasons.push(error.to_string()),
        }
    }
    let wanted: Vec<Value> = adapter::wanted_features()
        .iter_names()
        .map(|(name, f)| json!({ "name": name, "present": features.contains(f), "for": purpose(f) }))
        .collect();
    let cooperative = Cooperative::of(&adapter.cooperative_matrix_properties()).any();
    json!({
        "index": index,
        "name": info.name,
        "backend": info.backend.to_string(),
        "driver": format!("{} {}", info.driver, info.driver_info).trim(),
        "kind": format!("{:?}", info.device_type),
        "tier": tier,
        "usable": reasons.is_empty(),
        "shortcomings": reasons,
        "limits": {
            "storage_binding_bytes": limits.max_storage_buffer_binding_size,
            "uniform_binding_bytes": limits.max_uniform_buffer_binding_size,
            "buffer_bytes": limits.max_buffer_size,
            "storage_buffers_a_stage": limits.max_storage_buffers_per_shader_stage,
            "workgroup_memory_bytes": limits.max_compute_workgroup_storage_size,
            "invocations_a_workgroup": limits.max_compute_invocations_per_workgroup,
            "subgroup_lanes": [info.subgroup_min_size, info.subgroup_max_size],
        },
        "features": wanted,
        "cooperative_matrices": cooperative,
    })
}

fn text(fact: &Value, chosen: Option<usize>) -> String {
    let word = |key: &str| fact[key].as_str().unwrap_or("none").to_owned();
    let limit = |key: &str| fact["limits"][key].as_u64().unwrap_or(0);
    let default = chosen.is_some_and(|c| fact["index"] == c);
    let mut lines = vec![
        format!("{}: {}{}", fact["index"], word("name"), if default { "  (default)" } else { "" }),
        format!("   {}, {}, driver {}", word("kind"), word("backend"), word("driver")),
        format!(
            "   limits: storage binding {}, buffer {}, {} storage buffers, workgroup {} KiB and {} invocations, subgroups {} to {}",
            bytes::show(limit("storage_binding_bytes")),
            bytes::show(limit("buffer_bytes")),
            limit("storage_buffers_a_stage"),
            limit("workgroup_memory_bytes") >> 10,
            limit("invocations_a_workgroup"),
            fact["limits"]["subgroup_lanes"][0],
            fact["limits"]["subgroup_lanes"][1],
        ),
    ];
    for feature in fact["features"].as_array().into_iter().flatten() {
        let (name, purpose) = (feature["name"].as_str().unwrap_or(""), feature["for"].as_str().unwrap_or(""));
        let mark = if feature["present"] == true { "has" } else { "lacks" };
        lines.push(format!("   {mark} {name}: {purpose}"));
    }
    if fact["cooperative_matrices"] == true {
        lines.push(
            "   has cooperative matrices, with --experimental: faster products beside f16 and int8 weights".to_owned(),
        );
    }
    if fact["usable"] == true {
        lines.push(format!("   usable; kernel variants: {}", word("tier")));
    }
    for reason in fact["shortcomings"].as_array().into_iter().flatten() {
        lines.push(format!("   not usable: {}", reason.as_str().unwrap_or("")));
    }
    lines.join("\n")
}
