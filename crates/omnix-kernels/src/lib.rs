//! The kernels of omnix: what each computes, its variants, and how a call becomes dispatches.
//!
//! A kernel has one name and seven places: `shaders/<k>/`, `src/<k>.rs` here, its CPU oracle
//! `src/cpu/<k>.rs`, `tests/harness/cases/<k>.rs`, `tests/kernels/<k>.rs`, `benches/kernels/<k>.rs` and the operation
//! `omnix-graph/src/ops/<k>.rs`; `cargo xtask tidy` fails when one is missing. A kernel's `record` is a pure function from a specification and the [`Caps`] of a
//! device to a list of [`Dispatch`]es over numbered arguments. Only what lies in the folder `device/`, re-exported
//! here ([`adapter`], [`gpu`], [`program`], [`compile`], [`run`], [`readback`], [`host_memory`]), and `bench` (a feature) touch a device.
//!
//! Tensors are f32, contiguous, channels last: tokens `[image, token, channel]`, maps `[image, row, column, channel]`.

#[cfg(all(feature = "bench", not(target_arch = "wasm32")))]
pub mod bench;
pub mod caps;
pub mod cpu;
pub mod dispatch;
pub mod error;
pub mod layout;
pub mod packed;

mod activation;
mod attention_sweep;
mod cover;
mod device;
mod sections;

pub mod adamw;
pub mod attention;
pub mod attention_grad_kv;
pub mod attention_grad_q;
pub mod blend;
pub mod conv2d;
pub mod conv2d_weights;
pub mod copy;
pub mod deform_sample;
pub mod deform_sample_grad;
pub mod deform_sample_grad_field;
pub mod dropout;
pub mod field_scatter;
pub mod field_scatter_grad;
pub mod fill;
pub mod gather;
pub mod grad_norm;
pub mod layer_norm;
pub mod layer_norm_grad;
pub mod linear;
pub mod linear_weights;
pub mod pack;
pub mod pointwise;
pub mod rank;
pub mod reduce;
pub mod reference_view;
pub mod resize;
pub mod resize_grad;
pub mod scatter;
pub mod softmax;
pub mod splat;
pub mod split_heads;
pub mod split_heads_grad;
pub mod swiglu;
pub mod swiglu_grad;
pub mod token_expand;
pub mod token_expand_grad;
pub mod top_k;
pub mod traj_apply;
pub mod traj_apply_grad;
pub mod trajectory;
pub mod winograd;
pub mod winograd_weights;

pub use activation::Activation;
pub use caps::{Caps, Cooperative, Tier};
#[cfg(not(target_arch = "wasm32"))]
pub use device::why_software;
pub use device::{adapter, gpu, host_memory, program, readback};
#[cfg(not(target_arch = "wasm32"))]
pub use device::{compile, run};
pub use dispatch::{Arg, Dispatch};
pub use error::KernelError;
pub use gpu::Gpu;
pub use host_memory::HostMemory;
pub use packed::{PackedWeights, WeightType};
pub use program::{BufferSlice, Program};
