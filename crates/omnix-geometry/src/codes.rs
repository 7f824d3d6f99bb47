//! Fixed codes that networks add or turn by: position rows, UV codes, rotary tables, time codes.
//!
//! Sources: `spec/da3.md` 4.2 (position table), 4.4 (RoPE), 6.1 (UV), `spec/omnix.md` 3.6 (time). All depend on sizes alone
//! and are made once for a shape, in f64, rounded to f32 at the end.

/// The offset of the published position resampling, in output rows.
const POSITION_OFFSET: f64 = 0.1;
/// The bicubic kernel's parameter.
const CUBIC_A: f64 = -0.75;
/// Base of the UV code's frequencies.
const UV_BASE: f64 = 100.0;
/// Gain of the UV code.
const UV_GAIN: f64 = 0.1;

/// Where the channels of a map lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// `[channels, height, width]`
    ChannelsFirst,
    /// `[height, width, channels]`
    ChannelsLast,
}

/// Position rows for a grid of `rows` x `columns` patches from a stored table (`spec/da3.md` 4.2).
///
/// `table` is `[1 + grid*grid, channels]`: a row for the class token, then the grid row-major; `grid` is 37 in published
/// files. The result is `[1 + rows*columns, channels]`: the class row unchanged, then the grid resampled with the bicubic
/// kernel (a = -0.75, no antialias, border taps clamped) at `src = (o + 0.5) * grid/(n + 0.1) - 0.5`. Only a picture of
/// exactly `grid` x `grid` patches takes the table as it is.
///
/// # Panics
/// When `table` has another length or a size is 0.
#[must_use]
pub fn position_rows(table: &[f32], grid: usize, channels: usize, rows: usize, columns: usize) -> Vec<f32> {
    assert_eq!(table.len(), (1 + grid * grid) * channels, "BUG: a position table of another size");
    assert!(rows > 0 && columns > 0, "BUG: an empty patch grid");
    if rows == grid && columns == grid {
        return table.to_vec();
    }
    let (class, stored) = table.split_at(channels);
    let row_taps: Vec<_> = (0..rows).map(|o| cubic_taps(o, rows, grid)).collect();
    let column_taps: Vec<_> = (0..columns).map(|o| cubic_taps(o, columns, grid)).collect();
    let mut out = Vec::with_capacity((1 + rows * columns) * channels);
    out.extend_from_slice(class);
    let mut sums = vec![0.0f64; channels];
    for row in &row_taps {
        for column in &column_taps {
            sums.fill(0.0);
            for (y, wy) in row {
                for (x, wx) in column {
                    let stored = &stored[(y * grid + x) * channels..][..channels];
                    for (sum, value) in sums.iter_mut().zip(stored) {
                        *sum += wy * wx * f64::from(*value);
                    }
                }
            }
            out.extend(sums.iter().map(|&sum| sum as f32));
        }
    }
    out
}

/// The four taps (clamped index, weight) of output `o` of `n` over a line of `grid` stored values.
fn cubic_taps(o: usize, n: usize, grid: usize) -> [(usize, f64); 4] {
    let src = (o as f64 + 0.5) * grid as f64 / (n as f64 + POSITION_OFFSET) - 0.5;
    let (floor, f) = (src.floor(), src - src.floor());
    let inner = |x: f64| ((CUBIC_A + 2.0) * x - (CUBIC_A + 3.0)) * x * x + 1.0;
    let outer = |x: f64| ((CUBIC_A * x - 5.0 * CUBIC_A) * x + 8.0 * CUBIC_A) * x - 4.0 * CUBIC_A;
    let weights = [outer(1.0 + f), inner(f), inner(1.0 - f), outer(2.0 - f)];
    std::array::from_fn(|k| {
        let place = floor as i64 + k as i64 - 1;
        (place.clamp(0, grid as i64 - 1) as usize, weights[k])
    })
}

/// The UV code of a map (`spec/da3.md` 6.1), gain 0.1 included, in the given layout.
///
/// `height` x `width` is the map, `image` the height and width of the input picture, whose aspect alone counts. With
/// `a = W/H`, `r = sqrt(a^2 + 1)`: `u_j = (a/r)(2j - (w-1))/w`, `v_i = (1/r)(2i - (h-1))/h`; channels are
/// `[sin(u w_m) | cos(u w_m) | sin(v w_m) | cos(v w_m)]`, `w_m = 100^(-m/n)`, m = 0..n-1, `n = channels/4`.
///
/// # Panics
/// When `channels` is no multiple of 4 or a size is 0.
#[must_use]
pub fn uv_code(channels: usize, height: usize, width: usize, image: [usize; 2], layout: Layout) -> Vec<f32> {
    assert!(channels.is_multiple_of(4), "BUG: a UV code of {channels} channels, no multiple of 4");
    assert!(height > 0 && width > 0 && image[0] > 0 && image[1] > 0, "BUG: a UV code of an empty map");
    let quarter = channels / 4;
    let aspect = image[1] as f64 / image[0] as f64;
    let diagonal = aspect.hypot(1.0);
    let axis = |n: usize, span: f64| -> Vec<f32> {
        let positions = (0..n).map(|i| span * (2.0 * i as f64 - (n as f64 - 1.0)) / n as f64);
        positions.flat_map(|p| sin_cos(p, quarter, UV_BASE)).map(|v| (UV_GAIN * v) as f32).collect()
    };
    // Each [n, channels/2]: the code of one column (row), which all rows (columns) share.
    let (us, vs) = (axis(width, aspect / diagonal), axis(height, 1.0 / diagonal));
    let half = 2 * quarter;
    let mut out = Vec::with_capacity(channels * height * width);
    match layout {
        Layout::ChannelsLast => {
            for i in 0..height {
                for j in 0..width {
                    out.extend_from_slice(&us[j * half..][..half]);
                    out.extend_from_slice(&vs[i * half..][..half]);
                }
            }
        }
        Layout::ChannelsFirst => {
            for c in 0..half {
                for _ in 0..height {
                    out.extend((0..width).map(|j| us[j * half + c]));
                }
            }
            for c in 0..half {
                for i in 0..height {
                    out.extend(std::iter::repeat_n(vs[i * half + c], width));
                }
            }
        }
    }
    out
}

/// Cosines and sines of the rotary position code, each `[tokens, head_width/2]`.
#[derive(Debug, Clone, PartialEq)]
pub struct RopeTables {
    /// Cosines.
    pub cos: Vec<f32>,
    /// Sines.
    pub sin: Vec<f32>,
    /// Columns: half the head width.
    pub columns: usize,
}

/// Rotary tables for tokens at `(row, column)` (`spec/da3.md` 4.4, `spec/omnix.md` 3.4).
///
/// With head width D and q = D/4, column `k` of a table holds for k < q the angle `row * base^(-2k/(D/2))`, for
/// k = q + j the angle `column * base^(-2j/(D/2))`. Column k < q turns the channels (k, k + q); column q + j turns
/// (D/2 + j, D/2 + j + q): `y_a = x_a cos - x_b sin`, `y_b = x_b cos + x_a sin`.
///
/// # Panics
/// When `head_width` is no multiple of 4.
#[must_use]
pub fn rope_tables(positions: &[(u32, u32)], head_width: usize, base: f64) -> RopeTables {
    assert!(head_width.is_multiple_of(4), "BUG: rotary tables of head width {head_width}, no multiple of 4");
    let quarter = head_width / 4;
    let columns = 2 * quarter;
    let mut tables = RopeTables {
        cos: Vec::with_capacity(positions.len() * columns),
        sin: Vec::with_capacity(positions.len() * columns),
        columns,
    };
    let frequencies: Vec<f64> = frequencies(quarter, base).collect();
    for &(row, column) in positions {
        for position in [row, column] {
            for frequency in &frequencies {
                let (sin, cos) = (f64::from(position) * frequency).sin_cos();
                tables.cos.push(cos as f32);
                tables.sin.push(sin as f32);
            }
        }
    }
    tables
}

/// Positions of a view's tokens in blocks that attend within it: (0, 0) for token 0, then (r+1, c+1) row-major.
#[must_use]
pub fn local_positions(rows: u32, columns: u32) -> Vec<(u32, u32)> {
    let patches = (1..=rows).flat_map(|r| (1..=columns).map(move |c| (r, c)));
    std::iter::once((0, 0)).chain(patches).collect()
}

/// Positions of a view's tokens in blocks that attend over all views: (0, 0) for token 0, (1, 1) for every patch.
#[must_use]
pub fn global_positions(rows: u32, columns: u32) -> Vec<(u32, u32)> {
    let patches = std::iter::repeat_n((1, 1), rows as usize * columns as usize);
    std::iter::once((0, 0)).chain(patches).collect()
}

/// The time code (`spec/omnix.md` 3.6): `[sin(p w_k) | cos(p w_k)]`, `w_k = base^(-k/(width/2))`, for every `p`, as
/// `[positions, width]`. The release's base is 100.
///
/// # Panics
/// When `width` is odd.
#[must_use]
pub fn time_codes(positions: &[f64], width: usize, base: f64) -> Vec<f32> {
    assert!(width.is_multiple_of(2), "BUG: a time code of odd width {width}");
    positions.iter().flat_map(|&p| sin_cos(p, width / 2, base)).map(|v| v as f32).collect()
}

/// `base^(-k/n)`, k = 0..n-1.
fn frequencies(n: usize, base: f64) -> impl Iterator<Item = f64> {
    (0..n).map(move |k| base.powf(-(k as f64) / n as f64))
}

/// `[sin(p w_k) | cos(p w_k)]`, n of each.
fn sin_cos(p: f64, n: usize, base: f64) -> impl Iterator<Item = f64> {
    let sines = frequencies(n, base).map(move |w| (p * w).sin());
    sines.chain(frequencies(n, base).map(move |w| (p * w).cos()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubic_weights_sum_to_one_and_clamp() {
        for o in 0..20 {
            let taps = cubic_taps(o, 20, 37);
            let sum: f64 = taps.iter().map(|t| t.1).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        }
        // One output over the whole line: src = 0.5 * 37/1.1 - 0.5.
        assert_eq!(cubic_taps(0, 1, 37).map(|t| t.0), [15, 16, 17, 18]);
        assert_eq!(cubic_taps(0, 40, 37)[0].0, 0);
    }

    #[test]
    fn a_constant_table_stays_constant() {
        let rows = position_rows(&[2.5; 10 * 3], 3, 3, 4, 7);
        assert_eq!(rows.len(), (1 + 28) * 3);
        assert!(rows.iter().all(|v| (v - 2.5).abs() < 1e-6));
    }

    #[test]
    fn uv_layouts_hold_the_same_numbers() {
        let (c, h, w) = (8, 3, 5);
        let first = uv_code(c, h, w, [30, 50], Layout::ChannelsFirst);
        let last = uv_code(c, h, w, [30, 50], Layout::ChannelsLast);
        for k in 0..c {
            for i in 0..h {
                for j in 0..w {
                    assert_eq!(first[(k * h + i) * w + j], last[(i * w + j) * c + k]);
                }
            }
        }
        // By hand: u_0 = -(5/3)/sqrt(34/9) * 4/5, channel 0 = 0.1 sin(u_0), channel 1 at frequency 100^(-1/2).
        let u = -(5.0f64 / 3.0) / (34.0f64 / 9.0).sqrt() * 0.8;
        assert!((f64::from(first[0]) - 0.1 * u.sin()).abs() < 1e-8);
        assert!((f64::from(first[h * w]) - 0.1 * (u * 0.1).sin()).abs() < 1e-8);
        assert!((f64::from(first[2 * h * w]) - 0.1 * u.cos()).abs() < 1e-8);
    }

    #[test]
    fn rope_columns_are_row_then_column() {
        let tables = rope_tables(&[(0, 0), (3, 5)], 8, 100.0);
        assert_eq!((tables.columns, tables.cos.len()), (4, 8));
        assert_eq!(tables.cos[..4], [1.0; 4]);
        // D/2 = 4: frequencies 1 and 100^(-2/4) = 0.1.
        let angles: [f64; 4] = [3.0, 0.3, 5.0, 0.5];
        for (k, angle) in angles.into_iter().enumerate() {
            assert!((f64::from(tables.sin[4 + k]) - angle.sin()).abs() < 1e-7);
            assert!((f64::from(tables.cos[4 + k]) - angle.cos()).abs() < 1e-7);
        }
    }

    #[test]
    fn time_codes_are_sines_then_cosines() {
        let code = time_codes(&[0.0, 2.0], 4, 100.0);
        assert_eq!(code[..4], [0.0, 0.0, 1.0, 1.0]);
        assert!((f64::from(code[5]) - 0.2f64.sin()).abs() < 1e-8);
        assert!((f64::from(code[6]) - 2.0f64.cos()).abs() < 1e-7);
    }

    #[test]
    fn token_zero_stands_apart() {
        assert_eq!(local_positions(2, 2), [(0, 0), (1, 1), (1, 2), (2, 1), (2, 2)]);
        assert_eq!(global_positions(1, 2), [(0, 0), (1, 1), (1, 1)]);
    }
}
