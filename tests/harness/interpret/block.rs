//! Blocks of a tensor of the checkpoint: rows, or columns of a matrix.

use omnix_graph::Parameter;

/// The block of a tensor that a parameter stands for.
pub(super) fn block(parameter: &Parameter, all: &[f64]) -> Vec<f64> {
    let row = parameter.full.elements() / parameter.full.first().copied().unwrap_or(1).max(1);
    let columns = parameter.columns.clone().unwrap_or(0..row);
    let rows = all[parameter.rows.start * row..parameter.rows.end * row].chunks_exact(row.max(1));
    rows.flat_map(|r| &r[columns.clone()]).copied().collect()
}
