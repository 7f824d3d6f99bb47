//! A dispatch as data: which shader, which parameters, which windows of which arguments, how many workgroups.

use bytemuck::Pod;
use omnix_shaders::{Access, Shader};
use smallvec::SmallVec;

/// Index of a tensor among a kernel's arguments; each kernel names its own as constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Arg(pub u8);

impl Arg {
    /// An optional argument that is not there: a small zero buffer is bound.
    pub const ABSENT: Self = Self(u8::MAX);
}

/// A window of an argument, in bytes from the argument's start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Which argument.
    pub arg: Arg,
    /// First byte; a multiple of the device's offset alignment.
    pub offset: u64,
    /// Number of bytes; `None` is all that follows.
    pub size: Option<u64>,
}

impl From<Arg> for Window {
    fn from(arg: Arg) -> Self {
        Self { arg, offset: 0, size: None }
    }
}

impl Arg {
    /// Bytes `offset..offset + size` of this argument.
    #[must_use]
    pub fn window(self, offset: u64, size: u64) -> Window {
        Window { arg: self, offset, size: Some(size) }
    }

    /// This argument if `present`, else [`Arg::ABSENT`].
    #[must_use]
    pub fn when(self, present: bool) -> Self {
        if present { self } else { Self::ABSENT }
    }
}

/// One dispatch of one shader.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// The validated shader.
    pub shader: &'static Shader,
    /// The bytes of its `Params` (binding 0).
    pub params: SmallVec<[u8; 64]>,
    /// Bindings 1..n.
    pub windows: SmallVec<[Window; 8]>,
    /// Workgroups in x, y, z; 0 only to have the driver compile ([`crate::compile`]).
    pub groups: [u32; 3],
    /// About how many operations it takes, a multiply-add counted as two; of kernels that only move numbers, how many of them it
    /// sees. At most [`MAX_OPERATIONS`], except on processors.
    pub operations: u64,
}

/// Most operations of one dispatch. Drivers take a device for hung when a dispatch lasts, Windows after two seconds: this
/// many take a slow GPU (50 GFLOP/s in these kernels) half a second. Software devices that are no part of the system, such as
/// lavapipe, have no such watch, so `Tier::Software` is exempt.
pub const MAX_OPERATIONS: u64 = 25_000_000_000;

impl Dispatch {
    /// Records `shader` with `params`; `windows` are bindings 1..n in order, `groups` the total number
    /// of workgroups, folded over x and y (`lib/grid.wgsl`).
    ///
    /// # Panics
    /// On our own mistakes only: parameters or windows that do not match the shader, or no workgroup.
    #[must_use]
    pub fn new<P: Pod>(shader: &'static Shader, params: &P, windows: &[Window], groups: u64) -> Self {
        let bytes = bytemuck::bytes_of(params);
        assert_eq!(bytes.len(), shader.params_size as usize, "BUG: Params of {}/{}", shader.kernel, shader.variant);
        assert_eq!(windows.len() + 1, shader.bindings.len(), "BUG: bindings of {}/{}", shader.kernel, shader.variant);
        let operations = windows.iter().map(|window| window.size.unwrap_or(0) / 4).sum();
        Self { shader, params: bytes.into(), windows: windows.into(), groups: fold(groups), operations }
    }

    /// The same with the number of operations that its kernel counts.
    #[must_use]
    pub(crate) fn of_operations(self, operations: u64) -> Self {
        Self { operations, ..self }
    }

    /// Whether any workgroup writes `arg`.
    #[must_use]
    pub fn writes(&self, arg: Arg) -> bool {
        self.uses(arg).any(|access| access == Access::ReadWrite)
    }

    /// How each binding of `arg` is used.
    pub fn uses(&self, arg: Arg) -> impl Iterator<Item = Access> + '_ {
        self.windows.iter().zip(&self.shader.bindings[1..]).filter(move |(w, _)| w.arg == arg).map(|(_, b)| b.access)
    }
}

/// WebGPU's limit of workgroups in one dimension.
const MAX_GROUPS: u64 = 65_535;

/// Folds a number of workgroups over x and y. The shader sees up to one row too many and checks the bound.
///
/// # Panics
/// If there are no workgroups, or more than 65,535² (no tensor under the buffer limits gets near).
#[must_use]
pub fn fold(groups: u64) -> [u32; 3] {
    assert!(groups > 0 && groups <= MAX_GROUPS * MAX_GROUPS, "BUG: {groups} workgroups");
    let x = groups.min(MAX_GROUPS);
    let y = groups.div_ceil(x);
    [x as u32, y as u32, 1]
}

/// Rounds `n` up to a multiple of `to`.
#[must_use]
pub const fn round_up(n: u64, to: u64) -> u64 {
    n.div_ceil(to) * to
}

#[cfg(test)]
mod tests {
    use super::fold;

    #[test]
    fn fold_covers_and_stays_under_the_limit() {
        for n in [1, 2, 65_535, 65_536, 131_070, 131_071, 10_000_000] {
            let [x, y, z] = fold(n);
            assert!(x <= 65_535 && y <= 65_535 && z == 1);
            assert!(u64::from(x) * u64::from(y) >= n, "{n}");
        }
    }
}
