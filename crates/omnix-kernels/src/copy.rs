//! `y[dst.offset + Σ_d i_d · dst.strides[d]] = x[src.offset + Σ_d i_d · src.strides[d]]` for all `i` in a shape of up
//! to six dimensions of 32-bit elements: permutation, slice, concatenation (one copy per part), broadcast
//! (stride 0), the rearrangement of transposed convolutions, patches of an image.
//!
//! Elements of y that are not addressed keep their value. Two indices may not address one element of y.
//! Strides and offsets are in elements. Dimensions that are contiguous in both tensors are merged, and where
//! everything is a multiple of four elements, four are moved at a time.

use omnix_shaders::copy as shaders;

use crate::cover::{cover, room, steps, unit};
use crate::{Arg, Caps, Dispatch, KernelError};

/// What is read.
pub const X: Arg = Arg(0);
/// What is written; it may not be the buffer of [`X`].
pub const Y: Arg = Arg(1);

/// Where the elements of one side lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Strided {
    /// Element of index 0.
    pub offset: u64,
    /// Elements from one index to the next, dimension by dimension; 0 repeats.
    pub strides: [u32; 6],
}

impl Strided {
    /// The layout of a whole contiguous tensor.
    ///
    /// # Panics
    /// On our own mistake only: a stride above 2³² elements.
    #[must_use]
    pub fn contiguous(shape: [u32; 6]) -> Self {
        let mut strides = [0; 6];
        let mut stride = 1u64;
        for d in (0..6).rev() {
            assert!(u32::try_from(stride).is_ok(), "BUG: stride {stride}");
            strides[d] = stride as u32;
            stride *= u64::from(shape[d].max(1));
        }
        Self { offset: 0, strides }
    }
}

/// What to copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Copy {
    /// Extents, outermost first; unused dimensions are 1. Any 0 means that there is nothing to copy.
    pub shape: [u32; 6],
    /// Layout in [`X`].
    pub src: Strided,
    /// Layout in [`Y`].
    pub dst: Strided,
}

crate::layout::params! {
    /// `Params` of `shaders/copy`.
    pub struct CopyParams {
        dims: [[u32; 4]; 6],
        rank: u32,
        pieces: u32,
        steps: u32,
        total: u32,
        src0: u32,
        dst0: u32,
        pad0: u32,
        pad1: u32,
    }
}

/// One dimension: extent and strides, in the unit of the piece.
#[derive(Clone, Copy, Debug)]
struct Dim {
    n: u64,
    src: u64,
    dst: u64,
}

/// A part of the copy, its dimensions innermost first; all in units of `words` words.
struct Part {
    dims: Vec<Dim>,
    src: u64,
    dst: u64,
    words: u64,
}

impl Copy {
    /// Elements moved.
    #[must_use]
    pub fn elements(&self) -> u64 {
        self.shape.iter().map(|&n| u64::from(n)).product()
    }

    /// Bytes read and written.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        8 * self.elements()
    }

    /// The dispatches that compute this on a device with `caps`; none where the shape has a 0.
    ///
    /// # Errors
    /// When y would be written twice at one place: a stride of 0 in y over more than one index.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        if self.elements() == 0 {
            return Ok(Vec::new());
        }
        if (0..6).any(|d| self.shape[d] > 1 && self.dst.strides[d] == 0) {
            let reason = format!("shape {:?} with strides {:?} writes an element twice", self.shape, self.dst.strides);
            return Err(KernelError::Unsupported { kernel: "copy", reason });
        }
        let mut out = Vec::new();
        split(self.simplified(), caps, &mut out);
        Ok(out)
    }

    /// The whole copy with dimensions merged, the best innermost one chosen and the unit widened.
    fn simplified(&self) -> Part {
        let mut dims: Vec<Dim> = Vec::new();
        for d in (0..6).rev().filter(|&d| self.shape[d] > 1) {
            let dim = Dim {
                n: u64::from(self.shape[d]),
                src: u64::from(self.src.strides[d]),
                dst: u64::from(self.dst.strides[d]),
            };
            match dims.last_mut() {
                Some(inner) if dim.src == inner.n * inner.src && dim.dst == inner.n * inner.dst => inner.n *= dim.n,
                _ => dims.push(dim),
            }
        }
        // The line that eight invocations walk together: contiguous where it is long enough to occupy them.
        let long = |dim: &Dim| dim.n >= 8;
        let inner = dims
            .iter()
            .position(|d| d.dst == 1 && d.src == 1)
            .or_else(|| dims.iter().position(|d| d.dst == 1 && long(d)))
            .or_else(|| dims.iter().position(|d| d.src == 1 && long(d)))
            .or_else(|| (0..dims.len()).max_by_key(|&i| dims[i].n));
        match inner {
            Some(i) => {
                let dim = dims.remove(i);
                dims.insert(0, dim);
            }
            None => dims.push(Dim { n: 1, src: 1, dst: 1 }),
        }
        let mut part = Part { dims, src: self.src.offset, dst: self.dst.offset, words: 1 };
        let four = |n: u64| n.is_multiple_of(4);
        let line = part.dims[0];
        if (line.src, line.dst) == (1, 1)
            && four(line.n)
            && four(part.src)
            && four(part.dst)
            && part.dims[1..].iter().all(|d| four(d.src) && four(d.dst))
        {
            part.dims[0].n /= 4;
            for dim in &mut part.dims[1..] {
                (dim.src, dim.dst) = (dim.src / 4, dim.dst / 4);
            }
            (part.src, part.dst, part.words) = (part.src / 4, part.dst / 4, 4);
        }
        part
    }
}

/// Halves the dimension that reaches furthest until the addresses of either side fit into one binding.
fn split(part: Part, caps: &Caps, out: &mut Vec<Dispatch>) {
    let reach = |stride: fn(&Dim) -> u64| 1 + part.dims.iter().map(|d| (d.n - 1) * stride(d)).sum::<u64>();
    let (src, dst) = (reach(|d| d.src), reach(|d| d.dst));
    let room = room(caps) / part.words;
    if src <= room && dst <= room {
        out.push(dispatch(&part, src, dst, caps));
        return;
    }
    let stride = |d: &Dim| if src > room { d.src } else { d.dst };
    let widest = (0..part.dims.len()).max_by_key(|&i| (part.dims[i].n - 1) * stride(&part.dims[i])).unwrap_or(0);
    let dim = part.dims[widest];
    let first = dim.n.div_ceil(2);
    for (from, n) in [(0, first), (first, dim.n - first)] {
        let mut dims = part.dims.clone();
        dims[widest].n = n;
        split(
            Part { dims, src: part.src + from * dim.src, dst: part.dst + from * dim.dst, words: part.words },
            caps,
            out,
        );
    }
}

fn dispatch(part: &Part, src: u64, dst: u64, caps: &Caps) -> Dispatch {
    let words = part.words;
    let (x, src0) = cover(X, part.src * words, src * words, caps);
    let (y, dst0) = cover(Y, part.dst * words, dst * words, caps);
    let line = part.dims[0].n;
    let steps = u64::from(steps(caps, line as u32));
    let pieces = line.div_ceil(8 * steps);
    let total = pieces * part.dims[1..].iter().map(|d| d.n).product::<u64>();
    let mut dims = [[1, 0, 0, 0]; 6];
    for (to, dim) in dims.iter_mut().zip(&part.dims) {
        *to = [dim.n as u32, dim.src as u32, dim.dst as u32, 0];
    }
    let params = CopyParams {
        dims,
        rank: part.dims.len() as u32,
        pieces: pieces as u32,
        steps: steps as u32,
        total: total as u32,
        src0: src0 / words as u32,
        dst0: dst0 / words as u32,
        pad0: 0,
        pad1: 0,
    };
    let (shader, _) = unit(caps, words == 4, [&shaders::WORDS, &shaders::VEC4, &shaders::SOFTWARE]);
    Dispatch::new(shader, &params, &[x, y], total.div_ceil(8))
}
