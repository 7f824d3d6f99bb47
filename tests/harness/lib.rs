//! Shared by all test binaries: the device and its families of variants, trials, cases, an interpreter of graphs, losses, PyTorch files, seeded
//! numbers, comparison.

pub mod cases;
pub mod compare;
pub mod family;
pub mod interpret;
pub mod losses;
#[path = "../cli/pytorch.rs"]
pub mod pytorch;
pub mod rng;
pub mod trials;

pub use compare::{as_f16, assert_close, relative_error};
pub use family::{Family, family, gpu, rounds, tiers, with_max_binding};
pub use libtest_mimic::Trial;
pub use rng::Rng;
pub use trials::Trials;
