//! Position rows against `posembed.safetensors` (`spec/da3.md` 4.2); the 37x37 rows are the stored table itself.

use omnix_geometry::codes::position_rows;

use crate::fixture::{assert_relative, goldens};

#[test]
fn position_tables() {
    for golden in goldens("posembed.safetensors", &["tiny-a/posembed.safetensors"]) {
        let (shape, table) = golden.f32("posembed.37x37");
        let channels = shape[2];
        let mut grids = 0;
        for name in golden.names() {
            let grid = name.strip_prefix("posembed.").and_then(|grid| grid.split_once('x')).unwrap();
            let (rows, columns) = (grid.0.parse().unwrap(), grid.1.parse().unwrap());
            let found = position_rows(&table, 37, channels, rows, columns);
            assert_relative(&name, &found, &golden.f32(&name).1, 1e-5);
            grids += 1;
        }
        assert_eq!(grids, 7);
    }
}
