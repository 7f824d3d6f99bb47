//! Composes every variant of every kernel, validates it with naga under exactly the capabilities the
//! variant declares, checks what naga does not (`check/`), and writes the result as Rust: one module a kernel, one static a variant.
//!
//! A folder `k/` with a `k.toml` is a kernel. All failures are collected and reported together.

#[path = "check/mod.rs"]
mod check;
#[path = "compose/mod.rs"]
mod compose;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use naga::valid::{Capabilities, ValidationFlags, Validator};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sidecar {
    variant: Vec<Variant>,
}

/// One `[[variant]]` table of `k.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Variant {
    name: String,
    /// Source file; `k.wgsl` when left out.
    file: Option<String>,
    #[serde(default)]
    defines: BTreeMap<String, i64>,
    /// Device features the variant needs: "subgroup", "f16", "int64", "cooperative-matrix".
    #[serde(default)]
    requires: Vec<String>,
    doc: String,
}

fn main() {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let mut kernels: Vec<String> = fs::read_dir(&root)
        .expect("the package folder is readable")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| root.join(name).join(format!("{name}.toml")).is_file())
        .collect();
    kernels.sort();

    let mut rust = String::new();
    let mut failures = Vec::new();
    let mut all = Vec::new();
    for kernel in &kernels {
        println!("cargo:rerun-if-changed={}", root.join(kernel).display());
        match build_kernel(&root, kernel, &mut rust, &mut failures) {
            Ok(statics) => all.extend(statics.iter().map(|s| format!("&{kernel}::{s}"))),
            Err(error) => failures.push(error),
        }
    }
    for fixed in ["lib", "check", "compose", "build.rs"] {
        println!("cargo:rerun-if-changed={}", root.join(fixed).display());
    }
    // A new kernel folder changes the package folder itself.
    println!("cargo:rerun-if-changed={}", root.display());
    let _ = writeln!(
        rust,
        "/// Every variant of every kernel, sorted by kernel.\npub static ALL: &[&Shader] = &[{}];",
        all.join(", ")
    );
    assert!(failures.is_empty(), "invalid shaders:\n\n{}", failures.join("\n\n"));
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it")).join("shaders.rs");
    fs::write(out, rust).expect("OUT_DIR is writable");
}

/// Emits `pub mod k { … }`; returns the names of its statics.
fn build_kernel(
    root: &Path,
    kernel: &str,
    rust: &mut String,
    failures: &mut Vec<String>,
) -> Result<Vec<String>, String> {
    let folder = root.join(kernel);
    let sidecar =
        fs::read_to_string(folder.join(format!("{kernel}.toml"))).map_err(|e| format!("{kernel}.toml: {e}"))?;
    let sidecar: Sidecar = toml::from_str(&sidecar).map_err(|e| format!("{kernel}.toml: {e}"))?;
    let _ = writeln!(rust, "/// Variants of the kernel `{kernel}`.\npub mod {kernel} {{\n    use super::*;");
    let mut statics = Vec::new();
    for variant in &sidecar.variant {
        match build_variant(root, kernel, variant) {
            Ok(text) => {
                rust.push_str(&text);
                statics.push(variant.name.to_uppercase());
            }
            Err(error) => failures.push(format!("{kernel}/{}: {error}", variant.name)),
        }
    }
    rust.push_str("}\n");
    Ok(statics)
}

fn build_variant(root: &Path, kernel: &str, variant: &Variant) -> Result<String, String> {
    let file = variant.file.clone().unwrap_or_else(|| format!("{kernel}.wgsl"));
    let source = fs::read_to_string(root.join(kernel).join(&file)).map_err(|e| format!("{file}: {e}"))?;
    let load = |name: &str| {
        let path = root.join("lib").join(format!("{name}.wgsl"));
        fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))
    };
    let wgsl = compose::compose(&source, &variant.defines, &load).map_err(|e| format!("{file}: {e}"))?;
    let module = validate(&wgsl, variant).map_err(|error| match keep(kernel, variant, &wgsl) {
        Ok(path) => format!("{error}\ncomposed text: {}", path.display()),
        Err(_) => error,
    })?;
    emit(kernel, variant, &wgsl, &module)
}

/// Leaves a faulty text where it can be read, since line numbers are of it.
fn keep(kernel: &str, variant: &Variant, wgsl: &str) -> std::io::Result<PathBuf> {
    let folder = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    let path = folder.join(format!("{kernel}_{}.wgsl", variant.name));
    fs::write(&path, wgsl)?;
    Ok(path)
}

/// Checks a composed text under exactly the capabilities that its variant declares.
fn validate(wgsl: &str, variant: &Variant) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(wgsl).map_err(|e| e.emit_to_string(wgsl))?;
    let info = Validator::new(ValidationFlags::all(), capabilities(&variant.requires)?)
        .validate(&module)
        .map_err(|e| e.emit_to_string(wgsl))?;
    let findings = check::check(&module, &info, wgsl);
    if !findings.is_empty() {
        return Err(findings.join("\n"));
    }
    Ok(module)
}

/// What a plain WebGPU device offers, plus what the variant asks for.
fn capabilities(requires: &[String]) -> Result<Capabilities, String> {
    let mut caps = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
    for feature in requires {
        caps |= match feature.as_str() {
            "subgroup" => Capabilities::SUBGROUP,
            "f16" => Capabilities::SHADER_FLOAT16,
            "int64" => Capabilities::SHADER_INT64,
            "cooperative-matrix" => Capabilities::COOPERATIVE_MATRIX,
            other => return Err(format!("unknown feature `{other}` in requires")),
        };
    }
    Ok(caps)
}

/// Writes the static: text, bindings and parameter layout as naga sees them.
fn emit(kernel: &str, variant: &Variant, wgsl: &str, module: &naga::Module) -> Result<String, String> {
    let mut bindings = BTreeMap::new();
    let mut params = String::new();
    let mut params_size = 0;
    for (_, global) in module.global_variables.iter() {
        let Some(binding) = &global.binding else { continue };
        let kind = match global.space {
            naga::AddressSpace::Uniform => "Uniform",
            naga::AddressSpace::Storage { access } if access.contains(naga::StorageAccess::STORE) => "ReadWrite",
            naga::AddressSpace::Storage { .. } => "Read",
            other => return Err(format!("a binding in address space {other:?}")),
        };
        let name = global.name.clone().unwrap_or_default();
        if binding.binding == 0 {
            let naga::TypeInner::Struct { members, span } = &module.types[global.ty].inner else {
                return Err("binding 0 must be `var<uniform> p: Params`".to_owned());
            };
            params_size = *span;
            for member in members {
                let _ = write!(params, "({:?}, {}), ", member.name.clone().unwrap_or_default(), member.offset);
            }
        }
        bindings.insert(binding.binding, format!("BindingInfo {{ name: {name:?}, access: Access::{kind} }}"));
    }
    if bindings.keys().copied().ne(0..bindings.len() as u32) {
        return Err(format!("bindings must be 0..n without holes, found {:?}", bindings.keys()));
    }
    let list: Vec<_> = bindings.into_values().collect();
    let requires: Vec<_> = variant.requires.iter().map(|r| format!("{r:?}")).collect();
    Ok(format!(
        "    /// {doc}\n    pub static {id}: Shader = Shader {{ kernel: {kernel:?}, variant: {name:?}, wgsl: {wgsl:?}, \
         bindings: &[{bindings}], params: &[{params}], params_size: {params_size}, requires: &[{requires}] }};\n",
        doc = variant.doc,
        id = variant.name.to_uppercase(),
        name = variant.name,
        bindings = list.join(", "),
        requires = requires.join(", "),
    ))
}
