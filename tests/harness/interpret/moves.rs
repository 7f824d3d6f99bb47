//! What moves numbers without changing them: strided copies, rows by index.

use omnix_graph::Value;
use omnix_graph::ops::{Copies, Gather, Scatter};

use super::Run;

impl Run<'_> {
    pub(super) fn copies(&self, op: &Copies, y: Value) -> Vec<f64> {
        let mut y: Vec<Option<f64>> = vec![None; self.graph.shape(y).elements()];
        for (value, piece) in &op.pieces {
            let x = self.get(*value);
            for i in 0..piece.shape.iter().product::<u32>() {
                let (mut rest, mut from, mut to) = (i, piece.src.offset, piece.dst.offset);
                for axis in (0..6).rev() {
                    let at = rest % piece.shape[axis];
                    rest /= piece.shape[axis];
                    from += u64::from(at * piece.src.strides[axis]);
                    to += u64::from(at * piece.dst.strides[axis]);
                }
                let before = y[to as usize].replace(x[from as usize]);
                assert!(before.is_none(), "element {to} is written twice");
            }
        }
        let missing = |v: Option<f64>| match v {
            Some(v) => v,
            None if op.zeros => 0.0,
            None => panic!("the pieces do not cover the output"),
        };
        y.into_iter().map(missing).collect()
    }

    pub(super) fn gather(&self, op: &Gather) -> Vec<f64> {
        let x = self.get(op.x);
        let row = x.len() / self.dims(op.x)[0];
        self.indices(op.index).into_iter().flat_map(|i| &x[i * row..][..row]).copied().collect()
    }

    pub(super) fn scatter(&self, op: &Scatter) -> Vec<f64> {
        let mut y = self.get(op.base).to_vec();
        let row = y.len() / self.dims(op.base)[0];
        let mut written = vec![false; self.dims(op.base)[0]];
        for (i, from) in self.indices(op.index).into_iter().zip(self.get(op.x).chunks_exact(row)) {
            assert!(!std::mem::replace(&mut written[i], true), "row {i} is written twice");
            y[i * row..][..row].copy_from_slice(from);
        }
        y
    }
}
