//! The UV code added to maps (`spec/da3.md` 6.1).
//!
//! Half of its channels depend on the column alone and half on the row, so a table of columns and rows is stored, and a resize adds
//! it: at full picture size the whole code of a large network would take 70 MB.

use omnix_geometry::codes::{Layout, uv_code};
use omnix_graph::ops::{Corners, Filter};
use omnix_graph::{Graph, GraphError, Value};

/// The map x at this height and width, which may be its own, plus the code of its channels, gain included, for a picture of this height
/// and width.
pub(super) fn coded(g: &mut Graph, x: Value, (h, w): (usize, usize), picture: [usize; 2]) -> Result<Value, GraphError> {
    let c = g.shape(x).width();
    let code = g.constant("uv", [w + h, c / 2], table((h, w), c, picture));
    g.resize_coded(x, [h, w], Filter::Bilinear, Corners::Align, Some(code))
}

/// `[w + h, c/2]`: the code of each column, then of each row.
fn table((h, w): (usize, usize), c: usize, picture: [usize; 2]) -> Vec<f32> {
    let mut table = halves(&uv_code(c, 1, w, picture, Layout::ChannelsLast), c, 0);
    table.extend(halves(&uv_code(c, h, 1, picture, Layout::ChannelsLast), c, c / 2));
    table
}

/// Channels `first..first + c/2` of every pixel.
fn halves(code: &[f32], c: usize, first: usize) -> Vec<f32> {
    code.chunks_exact(c).flat_map(|pixel| &pixel[first..first + c / 2]).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_the_columns_and_rows_of_a_map() {
        let (h, w, c, picture) = (3, 5, 8, [42, 70]);
        let whole = uv_code(c, h, w, picture, Layout::ChannelsLast);
        let table = table((h, w), c, picture);
        let (columns, rows) = table.split_at(w * c / 2);
        for i in 0..h {
            for j in 0..w {
                let pixel = &whole[(i * w + j) * c..][..c];
                assert_eq!(pixel[..c / 2], columns[j * c / 2..][..c / 2]);
                assert_eq!(pixel[c / 2..], rows[i * c / 2..][..c / 2]);
            }
        }
    }
}
