//! The gradient of [`crate::field_scatter`]: `dz[t, s, i, :] = dfield[s, t, index[s, i], :]`, with 0 for an index out of range. What
//! the other cells hold is a constant.

use omnix_shaders::field_scatter_grad as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Gradient of the field, `[S, T, L, c]`.
pub const DFIELD: Arg = Arg(0);
/// u32 `[S, K]`: the tokens' cells.
pub const INDEX: Arg = Arg(1);
/// Output `[T, S, K, c]`.
pub const DZ: Arg = Arg(2);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FieldScatterGrad {
    /// Source images, S.
    pub sources: u32,
    /// Target times, T.
    pub times: u32,
    /// Chosen tokens of an image, K.
    pub k: u32,
    /// Cells of the grid, L.
    pub cells: u32,
    /// Channels.
    pub c: u32,
}

crate::layout::params! {
    /// `Params` of `shaders/field_scatter_grad`.
    pub struct FieldScatterGradParams {
        sources: u32,
        times: u32,
        all_sources: u32,
        all_times: u32,
        k: u32,
        cells: u32,
        c: u32,
        z_rest: u32,
        i_rest: u32,
        f_rest: u32,
        pad0: u32,
        pad1: u32,
    }
}

/// Source images and target times of one dispatch: first and number.
#[derive(Clone, Copy, Debug)]
struct Piece {
    source: (u64, u64),
    time: (u64, u64),
}

impl FieldScatterGrad {
    /// Bytes read and written.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        let pairs = self.sources as u64 * self.times as u64 * self.c as u64;
        4 * (2 * pairs * self.k as u64 + self.sources as u64 * self.k as u64)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, more tokens are chosen than there are cells, or one image's field at one time is larger than the
    /// device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let Self { sources, times, k, cells, c } = *self;
        if [sources, times, k, cells, c].contains(&0) || k > cells {
            let reason = format!(
                "{k} of {cells} cells, {c} channels, {sources} images at {times} times; none may be 0, nor more tokens \
                 chosen than there are cells"
            );
            return Err(KernelError::Unsupported { kernel: "field_scatter_grad", reason });
        }
        let mut out = Vec::new();
        self.split(Piece { source: (0, u64::from(sources)), time: (0, u64::from(times)) }, caps, &mut out)?;
        Ok(out)
    }

    /// Halves a piece, images first, until its windows fit.
    fn split(&self, piece: Piece, caps: &Caps, out: &mut Vec<Dispatch>) -> Result<(), KernelError> {
        let words = self.z_words(&piece).max(self.field_words(&piece));
        if words <= room(caps) {
            out.push(self.dispatch(&piece, caps));
            return Ok(());
        }
        let halves = |(first, n): (u64, u64)| [(first, n / 2), (first + n / 2, n - n / 2)];
        let pieces = if piece.source.1 > 1 {
            halves(piece.source).map(|source| Piece { source, ..piece })
        } else if piece.time.1 > 1 {
            halves(piece.time).map(|time| Piece { time, ..piece })
        } else {
            let limit = caps.max_binding;
            return Err(KernelError::RowTooLarge { kernel: "field_scatter_grad", bytes: words * 4, limit });
        };
        pieces.into_iter().try_for_each(|half| self.split(half, caps, out))
    }

    /// Words of z from the piece's first to its last.
    fn z_words(&self, piece: &Piece) -> u64 {
        ((piece.time.1 - 1) * u64::from(self.sources) + piece.source.1) * u64::from(self.k) * u64::from(self.c)
    }

    /// Words of the field from the piece's first to its last.
    fn field_words(&self, piece: &Piece) -> u64 {
        ((piece.source.1 - 1) * u64::from(self.times) + piece.time.1) * u64::from(self.cells) * u64::from(self.c)
    }

    fn dispatch(&self, piece: &Piece, caps: &Caps) -> Dispatch {
        let (all_sources, all_times) = (u64::from(self.sources), u64::from(self.times));
        let (k, cells, c) = (u64::from(self.k), u64::from(self.cells), u64::from(self.c));
        let ((s0, sources), (t0, times)) = (piece.source, piece.time);
        let (dz, z_rest) = cover(DZ, (t0 * all_sources + s0) * k * c, self.z_words(piece), caps);
        let (index, i_rest) = cover(INDEX, s0 * k, sources * k, caps);
        let (dfield, f_rest) = cover(DFIELD, (s0 * all_times + t0) * cells * c, self.field_words(piece), caps);
        let params = FieldScatterGradParams {
            sources: sources as u32,
            times: times as u32,
            all_sources: self.sources,
            all_times: self.times,
            k: self.k,
            cells: self.cells,
            c: self.c,
            z_rest,
            i_rest,
            f_rest,
            pad0: 0,
            pad1: 0,
        };
        let groups = (sources * times * k * c).div_ceil(64);
        Dispatch::new(&shaders::BASELINE, &params, &[dfield, index, dz], groups)
    }
}
