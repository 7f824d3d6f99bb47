//! `csv`: the followed points as text, for spreadsheets and scripts: `tracks.csv`, a line for each point and time.
//!
//! `point,image,column,row,time,time_s,x,y,z,motion,confidence,moving` with a heading. `image`, `column` and `row` say which pixel a point is,
//! `time` is the index of the image whose time it is. Numbers are written in the fewest digits that give them back.
//! A point of a film in windows that is lost has no line for the times at which it is.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::atomic::AtomicFile;
use super::format::{FileKind, Format, Points};
use super::motion::MovingPoints;
use crate::IoError;

const NAME: &str = "tracks.csv";

pub(super) const FORMAT: Format = Format {
    name: "csv",
    needs_motion: true,
    loses_points: true,
    files: &[FileKind::one(
        NAME,
        "the followed points at every time, a line each: pixel, time, x y z in the world, motion score, confidence",
    )
    .with(Points::Network)],
    disk: |size| size.paths(size.moving(), 110, 0).saturating_add(200),
    points: Some(|dir, points, _| write(&dir.join(NAME), points).map(|path| vec![path])),
    ..Format::NONE
};

fn write(path: &Path, points: &MovingPoints) -> Result<PathBuf, IoError> {
    points.check(FORMAT.name)?;
    let mut file = AtomicFile::create(path.to_owned())?;
    file.put(b"point,image,column,row,time,time_s,x,y,z,motion,confidence,moving\n")?;
    let times: Vec<String> =
        points.views.iter().map(|view| view.time.time_s.map(|s| s.to_string()).unwrap_or_default()).collect();
    for k in 0..points.len() {
        let (image, [column, row]) = (points.source[k], points.pixel[k]);
        let (motion, confidence, moving) = (points.motion[k], points.confidence[k], u8::from(points.moving[k]));
        for (time, seconds) in times.iter().enumerate() {
            let [x, y, z] = points.position(time, k);
            if !(x.is_finite() && y.is_finite() && z.is_finite()) {
                continue;
            }
            writeln!(
                file.writer(),
                "{k},{image},{column},{row},{time},{seconds},{x},{y},{z},{motion},{confidence},{moving}"
            )
            .map_err(|e| IoError::write(path, e))?;
        }
    }
    file.commit()
}
