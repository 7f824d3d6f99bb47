//! `dw[n, k] = Σ_m dy[m, n] · x[m, k]` and, where wanted, `db[n] = Σ_m dy[m, n]`: the gradients of [`crate::linear`]'s weights and
//! bias, all row-major.
//!
//! The rows are cut into sections of whole parts of 64 rows (`sections.rs`). A part is summed row by row, parts are joined in order,
//! sections, which wait in [`PARTS`], too. The cuts follow from the shape alone: splitting at the binding limit changes no bit.

use omnix_shaders::{Shader, linear_weights as shaders};

use crate::cover::{cover, room, unit};
use crate::dispatch::round_up;
use crate::sections::{Run, Sections};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// The layer's input `[m, k]`.
pub const X: Arg = Arg(0);
/// Gradient of the layer's output `[m, n]`.
pub const DY: Arg = Arg(1);
/// Output `[n, k]`.
pub const DW: Arg = Arg(2);
/// Output `[n]`.
pub const DB: Arg = Arg(3);
/// Scratch of [`LinearWeights::parts_words`] numbers.
pub const PARTS: Arg = Arg(4);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LinearWeights {
    /// Rows.
    pub m: u32,
    /// Columns of dy.
    pub n: u32,
    /// Columns of x.
    pub k: u32,
    /// Whether [`DB`] is there.
    pub bias: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/linear_weights`.
    #[derive(Default)]
    pub struct LinearWeightsParams {
        m: u32,
        section: u32,
        n: u32,
        n0: u32,
        n1: u32,
        k: u32,
        n_tiles: u32,
        k_tiles: u32,
        out_rest: u32,
        out_step: u32,
        len: u32,
        count: u32,
        in_rest: u32,
        flags: u32,
        pad0: u32,
        pad1: u32,
    }
}

const KERNEL: &str = "linear_weights";
const GO_ON: u32 = 1;
/// Rows of a part.
pub(crate) const PART: u64 = 64;
/// Tiles of 32 x 32 sums that keep a large GPU busy; a processor needs fewer. Below that the rows are cut.
const TILES: u64 = 1024;
/// A section is not shorter than this but the last one.
const LEAST: u64 = 256;
/// Rows of a longer section that a dispatch sums on software devices: what its tiles read again stays in a cache.
const SOFTWARE_ROWS: u64 = 1024;

impl LinearWeights {
    /// Multiply-adds, each counted as two operations.
    #[must_use]
    pub fn flops(&self) -> u64 {
        2 * u64::from(self.m) * u64::from(self.n) * u64::from(self.k)
    }

    /// 32-bit words of [`PARTS`]: 0 where nothing waits there, and the argument is not bound.
    #[must_use]
    pub fn parts_words(&self) -> u64 {
        let [_, bias] = self.places();
        bias.start + bias.words()
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, or 64 rows of x or dy, or 64 columns of x's weights, are larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        if self.m == 0 || self.n == 0 || self.k == 0 {
            let reason = format!("{} rows, dy of {} columns, x of {}: none may be 0", self.m, self.n, self.k);
            return Err(KernelError::Unsupported { kernel: KERNEL, reason });
        }
        let [weights, bias] = self.places();
        let mut out = Vec::new();
        self.products(weights, caps, &mut out)?;
        if self.bias {
            let (rows, columns) = (u64::from(self.m), u64::from(self.n));
            column_sums(KERNEL, (DY, [rows, columns]), (PARTS, bias.start), DB, caps, &mut out)?;
        }
        Ok(out)
    }

    /// Where the sums of sections wait: those of dw, then those of db.
    fn places(&self) -> [Place; 2] {
        let tiles = u64::from(self.n).div_ceil(32) * u64::from(self.k).div_ceil(32);
        let sections = Sections::new(self.m.into(), PART, TILES.div_ceil(tiles.max(1)), LEAST);
        let weights = Place { sections, start: 0, step: u64::from(self.n) * u64::from(self.k) };
        let start = round_up(weights.words(), 64);
        let columns = if self.bias { u64::from(self.n) } else { 0 };
        [weights, Place { sections: column_sections(self.m.into(), columns), start, step: columns }]
    }

    fn products(&self, place: Place, caps: &Caps, out: &mut Vec<Dispatch>) -> Result<(), KernelError> {
        let [m, n, k] = [self.m, self.n, self.k].map(u64::from);
        let limit = caps.max_binding;
        let row_bytes = n.max(k) * 4;
        if row_bytes * PART > limit && m * row_bytes > limit {
            return Err(KernelError::RowTooLarge { kernel: KERNEL, bytes: row_bytes * PART, limit });
        }
        // Rows of dw whose numbers, and whose products with one part, are few enough for a dispatch: whole tiles.
        let padded = 2 * PART * k.next_multiple_of(64);
        let columns = (room(caps) / k).min(caps.max_operations() / padded);
        let columns = if columns >= n { n } else { columns / 64 * 64 };
        if columns == 0 {
            return Err(KernelError::RowTooLarge { kernel: KERNEL, bytes: 64 * k * 4, limit });
        }
        let (shader, form) = self.variant(caps);
        let short = caps.max_operations() / (2 * columns.next_multiple_of(64) * k.next_multiple_of(64));
        let mut fit = caps.rows_per_window(m, row_bytes).min((short / PART * PART).max(PART));
        if caps.tier == Tier::Software && place.sections.each > SOFTWARE_ROWS {
            fit = fit.min(SOFTWARE_ROWS);
        }
        let fit = if fit >= m { m.next_multiple_of(PART) } else { fit / PART * PART };
        let direct = place.sections.count() == 1;
        for n0 in (0..n).step_by(columns as usize) {
            let n1 = (n0 + columns).min(n);
            let len = (n1 - n0) * k;
            let most = (room(caps).saturating_sub(len) / place.step + 1).max(1);
            for run in place.sections.runs(fit, most) {
                let (arg, first) =
                    if direct { (DW, n0 * k) } else { (PARTS, place.start + run.section * place.step + n0 * k) };
                let target = cover(arg, first, (run.sections - 1) * place.step + len, caps);
                out.push(self.dispatch(shader, form, run, (n0, n1), place, target));
            }
        }
        if !direct {
            add(KERNEL, (PARTS, place.start, place.step), place.sections.count(), (DW, 0, n * k), caps, out)?;
        }
        Ok(())
    }

    /// The variant, and the columns of dy and of x that a tile has.
    fn variant(&self, caps: &Caps) -> (&'static Shader, u64) {
        let fours = self.n.is_multiple_of(4) && self.k.is_multiple_of(4);
        match caps.tier {
            Tier::Software if fours => (&shaders::SOFTWARE, 32),
            Tier::Gpu if fours => (&shaders::GPU, 64),
            _ => (&shaders::BASELINE, 4),
        }
    }

    fn dispatch(
        &self,
        shader: &'static Shader,
        tile: u64,
        run: Run,
        (n0, n1): (u64, u64),
        place: Place,
        (target, rest): (crate::dispatch::Window, u32),
    ) -> Dispatch {
        let [n, k] = [self.n, self.k].map(u64::from);
        let (n_tiles, k_tiles) = ((n1 - n0).div_ceil(tile), k.div_ceil(tile));
        let tiles = n_tiles * k_tiles * run.sections;
        let params = LinearWeightsParams {
            m: run.rows as u32,
            section: place.sections.each as u32,
            n: self.n,
            n0: n0 as u32,
            n1: n1 as u32,
            k: self.k,
            n_tiles: n_tiles as u32,
            k_tiles: k_tiles as u32,
            out_rest: rest,
            out_step: place.step as u32,
            flags: if run.go_on { GO_ON } else { 0 },
            ..LinearWeightsParams::default()
        };
        let rows = |arg: Arg, width: u64| arg.window(run.row0 * width * 4, run.rows * width * 4);
        let groups = if tile == 4 { tiles.div_ceil(64) } else { tiles };
        let operations = 2 * run.rows * n_tiles * k_tiles * tile * tile;
        Dispatch::new(shader, &params, &[rows(X, k), rows(DY, n), target], groups).of_operations(operations)
    }
}

/// Sums of sections side by side.
#[derive(Clone, Copy, Debug)]
struct Place {
    sections: Sections,
    /// First word.
    start: u64,
    /// Words of a section's sums.
    step: u64,
}

impl Place {
    /// Words that wait: none where one section's sums are the result.
    const fn words(&self) -> u64 {
        let count = self.sections.count();
        if count > 1 { count * self.step } else { 0 }
    }
}

/// Products of several pairs of matrices that lie one after the other, on software devices, for any kernel: `to[i] = dy[i]ᵀ x[i]`, with n and k
/// multiples of 4.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Batch {
    /// Pairs.
    pub count: u64,
    /// Rows of each matrix.
    pub rows: u64,
    /// Columns of dy.
    pub n: u64,
    /// Columns of x.
    pub k: u64,
    /// Whether the sums go on from what the output holds.
    pub go_on: bool,
}

impl Batch {
    /// The dispatch for x, dy and the output.
    pub(crate) fn dispatch(self, windows: [crate::dispatch::Window; 3]) -> Dispatch {
        let Self { count, rows, n, k, go_on } = self;
        let (n_tiles, k_tiles) = (n.div_ceil(32), k.div_ceil(32));
        let params = LinearWeightsParams {
            m: (count * rows) as u32,
            section: rows as u32,
            n: n as u32,
            n0: 0,
            n1: n as u32,
            k: k as u32,
            n_tiles: n_tiles as u32,
            k_tiles: k_tiles as u32,
            out_step: (n * k) as u32,
            flags: if go_on { GO_ON } else { 0 },
            ..LinearWeightsParams::default()
        };
        Dispatch::new(&shaders::SOFTWARE, &params, &windows, n_tiles * k_tiles * count)
    }
}

/// How the rows of column sums are cut.
pub(crate) fn column_sections(rows: u64, columns: u64) -> Sections {
    Sections::new(rows, PART, 16_384u64.div_ceil(columns.max(1)), LEAST)
}

/// Scratch words of [`column_sums`].
pub(crate) fn column_words(rows: u64, columns: u64) -> u64 {
    Place { sections: column_sections(rows, columns), start: 0, step: columns }.words()
}

/// `to[c] = Σ_m x[m, c]` over rows of any kernel: sections wait in `scratch` from a word that is a multiple of 64.
pub(crate) fn column_sums(
    kernel: &'static str,
    (x, [rows, columns]): (Arg, [u64; 2]),
    (scratch, start): (Arg, u64),
    to: Arg,
    caps: &Caps,
    out: &mut Vec<Dispatch>,
) -> Result<(), KernelError> {
    let sections = column_sections(rows, columns);
    let row_bytes = columns * 4;
    let fit = caps.rows_per_window(rows, row_bytes);
    if fit.min(rows) * row_bytes > caps.max_binding {
        return Err(KernelError::RowTooLarge { kernel, bytes: PART * row_bytes, limit: caps.max_binding });
    }
    let fit = if fit >= rows { rows.next_multiple_of(PART) } else { fit };
    let (shader, width) =
        unit(caps, columns.is_multiple_of(4), [&shaders::COLUMNS, &shaders::COLUMNS4, &shaders::COLUMNS_SOFTWARE]);
    let width = u64::from(width);
    let direct = sections.count() == 1;
    for run in sections.runs(fit, (room(caps) / columns).max(1)) {
        let (arg, first) = if direct { (to, 0) } else { (scratch, start + run.section * columns) };
        let (target, rest) = cover(arg, first, run.sections * columns, caps);
        let params = LinearWeightsParams {
            m: run.rows as u32,
            section: sections.each as u32,
            n: (columns / width) as u32,
            out_rest: rest / width as u32,
            out_step: (columns / width) as u32,
            flags: if run.go_on { GO_ON } else { 0 },
            ..LinearWeightsParams::default()
        };
        let rows = x.window(run.row0 * row_bytes, run.rows * row_bytes);
        out.push(Dispatch::new(shader, &params, &[rows, target], (run.sections * columns / width).div_ceil(64)));
    }
    if !direct {
        add(kernel, (scratch, start, columns), sections.count(), (to, 0, columns), caps, out)?;
    }
    Ok(())
}

/// `to[first + i] = ((from[start + i] + from[start + step + i]) + ..)` for `len` numbers of `count` sections, for any kernel.
pub(crate) fn add(
    kernel: &'static str,
    (from, start, step): (Arg, u64, u64),
    count: u64,
    (to, first, len): (Arg, u64, u64),
    caps: &Caps,
    out: &mut Vec<Dispatch>,
) -> Result<(), KernelError> {
    let fours = [start, step, first, len].iter().all(|n| n.is_multiple_of(4));
    let (shader, width) = unit(caps, fours, [&shaders::ADD, &shaders::ADD4, &shaders::ADD_SOFTWARE]);
    let piece = room(caps) / 64 * 64;
    if piece == 0 {
        return Err(KernelError::RowTooLarge { kernel, bytes: 512, limit: caps.max_binding });
    }
    for skip in (0..len).step_by(piece as usize) {
        let here = piece.min(len - skip);
        // Sections that one binding holds.
        let together = (room(caps).saturating_sub(here) / step.max(1) + 1).min(count);
        for section in (0..count).step_by(together as usize) {
            let sections = together.min(count - section);
            let (source, in_rest) = cover(from, start + section * step + skip, (sections - 1) * step + here, caps);
            let (target, out_rest) = cover(to, first + skip, here, caps);
            let params = LinearWeightsParams {
                len: here as u32 / width,
                count: sections as u32,
                in_rest: in_rest / width,
                out_rest: out_rest / width,
                out_step: step as u32 / width,
                flags: if section > 0 { GO_ON } else { 0 },
                ..LinearWeightsParams::default()
            };
            let groups = (here / u64::from(width)).div_ceil(64);
            out.push(Dispatch::new(shader, &params, &[source, target], groups));
        }
    }
    Ok(())
}
