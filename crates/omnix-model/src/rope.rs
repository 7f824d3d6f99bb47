//! Rotary tables: by place within a view, one step between token 0 and every patch over all views.

use omnix_geometry::codes::{RopeTables, global_positions, local_positions, rope_tables};
use omnix_graph::{Graph, Value};

use crate::block::Span;
use crate::config::BackboneConfig;

/// The two tables, `[T, head width]` each.
#[derive(Clone, Copy)]
pub(crate) struct Rope {
    local: Value,
    global: Value,
}

impl Rope {
    pub(crate) fn of(self, span: Span) -> Value {
        match span {
            Span::Groups(_) => self.local,
            Span::All => self.global,
        }
    }
}

/// The tables of a grid, if the network turns its queries at all.
pub(crate) fn tables(g: &mut Graph, config: &BackboneConfig, grid: (usize, usize)) -> Option<Rope> {
    config.rope_from?;
    let (rows, columns) = (grid.0 as u32, grid.1 as u32);
    let (width, base) = (config.head_dim(), config.rope_base);
    let local = table(g, "rope.local", &local_positions(rows, columns), width, base);
    Some(Rope { local, global: table(g, "rope.global", &global_positions(rows, columns), width, base) })
}

/// A row for each position, for heads of `width` channels: `[positions, width]`.
pub(crate) fn table(g: &mut Graph, name: &str, positions: &[(u32, u32)], width: usize, base: f64) -> Value {
    g.constant(name, [positions.len(), width], interleave(&rope_tables(positions, width, base)))
}

/// Rows of cosines then sines, as the kernel wants them.
fn interleave(tables: &RopeTables) -> Vec<f32> {
    let rows = tables.cos.chunks_exact(tables.columns).zip(tables.sin.chunks_exact(tables.columns));
    rows.flat_map(|(cos, sin)| cos.iter().chain(sin)).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_cosines_then_sines() {
        let tables = rope_tables(&[(0, 0), (1, 2)], 8, 100.0);
        let rows = interleave(&tables);
        assert_eq!(rows.len(), 16);
        assert_eq!(rows[..8], [1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(rows[8..12], tables.cos[4..8]);
        assert_eq!(rows[12..], tables.sin[4..8]);
    }
}
