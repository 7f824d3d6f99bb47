//! The WGSL kernels of omnix as text that has already been validated.
//!
//! Every variant of every kernel is composed (`compose/`) and checked by naga, and by `check/`, when this crate is
//! built, so no text that could fail to validate reaches a device. There is one module a kernel and
//! one `static` a variant: a wrong name is a compile error. No wgpu here: any engine can take these.

#[cfg(test)]
#[path = "../check/mod.rs"]
mod check;
#[cfg(test)]
#[path = "../compose/mod.rs"]
mod compose;

/// How a kernel uses a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// `var<uniform>`.
    Uniform,
    /// `var<storage, read>`.
    Read,
    /// `var<storage, read_write>`.
    ReadWrite,
}

/// One binding of group 0, in binding order.
#[derive(Clone, Copy, Debug)]
pub struct BindingInfo {
    /// The variable's name in the shader.
    pub name: &'static str,
    /// How the shader uses it.
    pub access: Access,
}

/// One validated variant of a kernel. The entry point is `main`, the bind group is 0, and binding 0
/// is the uniform `p: Params`.
#[derive(Debug)]
#[non_exhaustive]
pub struct Shader {
    /// Kernel name: the folder's.
    pub kernel: &'static str,
    /// Variant name from the sidecar file.
    pub variant: &'static str,
    /// The composed text.
    pub wgsl: &'static str,
    /// Bindings 0..n of group 0.
    pub bindings: &'static [BindingInfo],
    /// Members of `Params`: name and byte offset.
    pub params: &'static [(&'static str, u32)],
    /// Size of `Params` in bytes, padding included.
    pub params_size: u32,
    /// Device features the variant needs beyond WebGPU's baseline: "subgroup", "f16", "int64", "cooperative-matrix".
    pub requires: &'static [&'static str],
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
