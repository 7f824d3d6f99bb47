//! `csv` and `ply_seq`: every point at every time, read back and compared with what went in.

use std::collections::HashMap;

use omnix_io::Export;
use omnix_io::output::{MotionOptions, write_motion};

use crate::made;

#[test]
fn a_table_has_a_line_for_every_point_and_time() {
    let dir = tempfile::tempdir().unwrap();
    let points = made::points(3, 2);
    let written = write_motion(&[Export::Csv], &points, dir.path(), &MotionOptions::default()).unwrap();
    let text = std::fs::read_to_string(&written[0]).unwrap();
    let mut lines = text.lines();
    let heading: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<HashMap<&str, &str>> =
        lines.map(|line| heading.iter().copied().zip(line.split(',')).collect()).collect();
    assert_eq!(rows.len(), 3 * points.len());
    for (row, number) in rows.iter().zip(0..) {
        let (point, time) = (number / 3, number % 3);
        let value = |name: &str| row[name].parse::<f64>().unwrap();
        let [x, y, z] = points.position(time, point).map(f64::from);
        // Digits that give an f32 back need not give its f64.
        assert!([("x", x), ("y", y), ("z", z)].iter().all(|(name, v)| value(name) as f32 == *v as f32), "{row:?}");
        let [column, row_of] = points.pixel[point];
        let whole = [
            ("point", point as u32),
            ("image", points.source[point]),
            ("column", column),
            ("row", row_of),
            ("time", time as u32),
        ];
        assert!(whole.iter().all(|(name, v)| row[name] == v.to_string()), "{row:?}");
        assert_eq!(value("motion") as f32, points.motion[point]);
        assert_eq!(row["moving"], if points.moving[point] { "1" } else { "0" });
        assert_eq!(row["time_s"].parse().ok(), points.views[time].time.time_s);
    }
}

#[test]
fn a_sequence_has_the_same_points_in_every_file() {
    let dir = tempfile::tempdir().unwrap();
    let points = made::points(3, 2);
    let written = write_motion(&[Export::PlySeq], &points, dir.path(), &MotionOptions::default()).unwrap();
    assert_eq!(written.len(), 3);
    for (time, path) in written.iter().enumerate() {
        let bytes = std::fs::read(path).unwrap();
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let header = String::from_utf8_lossy(&bytes[..end]);
        assert!(header.contains(&format!("element vertex {}\n", points.len())), "{header}");
        let vertices: Vec<&[u8]> = bytes[end..].chunks(35).collect();
        assert_eq!(vertices.len(), points.len());
        for (k, vertex) in vertices.iter().enumerate() {
            let float = |at: usize| f32::from_le_bytes(vertex[at..at + 4].try_into().unwrap());
            assert_eq!([float(0), float(4), float(8)], points.position(time, k));
            assert_eq!(
                (&vertex[12..15], float(15), float(19)),
                (&points.colours[k][..], points.motion[k], points.confidence[k])
            );
            let whole = |at: usize| u32::from_le_bytes(vertex[at..at + 4].try_into().unwrap());
            assert_eq!((whole(23), [whole(27), whole(31)]), (points.source[k], points.pixel[k]));
        }
    }
}
