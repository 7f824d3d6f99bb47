//! The UV code added to maps (`spec/da3.md` 6.1).
//!
//! Half of its channels depend on the column alone and half on the row, so a narrow table is stored: at full picture size the whole code
//! of a large network would take 70 MB. A resize adds it as it is ([`table`]); elsewhere it is spread over the map on the device
//! ([`map`]).

use omnix_geometry::codes::{Layout, uv_code};
use omnix_graph::build::Piece;
use omnix_graph::{Graph, GraphError, Value};

/// The code of a map as `Graph::resize_coded` takes it, `[w + h, c/2]`: of each column, then of each row.
pub(super) fn table(g: &mut Graph, (h, w): (usize, usize), c: usize, picture: [usize; 2]) -> Value {
    let half = c / 2;
    let mut table = halves(&uv_code(c, 1, w, picture, Layout::ChannelsLast), c, 0);
    table.extend(halves(&uv_code(c, h, 1, picture, Layout::ChannelsLast), c, half));
    g.constant("uv.table", [w + h, half], table)
}

/// The code `[h, w, c]` of a map, gain included, for a picture of this height and width.
pub(super) fn map(g: &mut Graph, (h, w): (usize, usize), c: usize, picture: [usize; 2]) -> Result<Value, GraphError> {
    let half = c / 2;
    let (value, dims) = (table(g, (h, w), c, picture), vec![h, w, half]);
    let pieces = [
        Piece { value, dims: dims.clone(), start: 0, strides: vec![0, half, 1], at: vec![0, 0, 0] },
        Piece { value, dims, start: w * half, strides: vec![half, 0, 1], at: vec![0, 0, half] },
    ];
    g.assemble([h, w, c], &pieces)
}

/// Channels `first..first + c/2` of every pixel.
fn halves(code: &[f32], c: usize, first: usize) -> Vec<f32> {
    code.chunks_exact(c).flat_map(|pixel| &pixel[first..first + c / 2]).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_its_columns_and_rows() {
        let (h, w, c, picture) = (3, 5, 8, [42, 70]);
        let whole = uv_code(c, h, w, picture, Layout::ChannelsLast);
        let columns = halves(&uv_code(c, 1, w, picture, Layout::ChannelsLast), c, 0);
        let rows = halves(&uv_code(c, h, 1, picture, Layout::ChannelsLast), c, c / 2);
        for i in 0..h {
            for j in 0..w {
                let pixel = &whole[(i * w + j) * c..][..c];
                assert_eq!(pixel[..c / 2], columns[j * c / 2..][..c / 2]);
                assert_eq!(pixel[c / 2..], rows[i * c / 2..][..c / 2]);
            }
        }
    }
}
