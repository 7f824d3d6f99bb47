//! Paths of chosen points of one image, as a table: what a query of a field gives.
//!
//! `.npz`: T times that were asked for, N points.
//! * `trajectory` `f32 [T,N,3]`: where each point is at each time; world frame, OpenCV axes, the network's scale; NaN where it is lost
//! * `pixel` `i32 [N,2]`: column and row in the processed picture; `rgb` `u8 [N,3]`: its colour, where the picture is known
//! * `confidence` `f32 [N]`: of the path, at least 1; `theta` `f32 [N]`: motion score; `moving` `bool [N]`: whether it moves at all
//! * `source` `i32 [1]`: the image; `time`, `video`, `frame` `i32 [T]`; `seconds` `f64 [T]`, NaN where unknown
//!
//! CSV (RFC 4180, a header line): `image,x,y,time,video,frame,seconds,px,py,pz,theta,confidence,moving`, one line per point and
//! time where the point is not lost, points in their order. Numbers are the shortest that give back the f32.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::atomic::AtomicFile;
use super::motion::ImageTime;
use super::npy::{Array, write_npz};
use crate::IoError;

/// Paths of points of one image.
#[derive(Clone, Copy, Debug)]
pub struct PathTable<'a> {
    /// Source image.
    pub image: usize,
    /// The target times, ascending or not.
    pub times: &'a [usize],
    /// When they are, for each of `times`.
    pub when: &'a [ImageTime],
    /// Columns and rows.
    pub pixels: &'a [[u32; 2]],
    /// `[times][pixels][3]`; NaN where a point is lost.
    pub positions: &'a [f32],
    /// `[pixels]`, at least 1.
    pub confidence: &'a [f32],
    /// `[pixels]`: motion score θ.
    pub theta: &'a [f32],
    /// `[pixels]`: whether the gate lets it move.
    pub moving: &'a [bool],
    /// `[pixels]`.
    pub colours: Option<&'a [[u8; 3]]>,
}

impl PathTable<'_> {
    /// Writes an archive.
    ///
    /// # Errors
    /// A failure of writing; then there is no file.
    pub fn write_npz(&self, path: &Path) -> Result<PathBuf, IoError> {
        let (t, n) = (self.times.len(), self.pixels.len());
        let mut arrays = vec![
            Array::f32("trajectory", vec![t, n, 3], self.positions.iter().copied()),
            Array::i32("pixel", vec![n, 2], self.pixels.iter().flatten().map(|&v| v as i32)),
            Array::f32("confidence", vec![n], self.confidence.iter().copied()),
            Array::f32("theta", vec![n], self.theta.iter().copied()),
            Array::bool("moving", vec![n], self.moving),
            Array::i32("source", vec![1], [self.image as i32]),
            Array::i32("time", vec![t], self.times.iter().map(|&t| t as i32)),
            Array::i32("video", vec![t], self.when.iter().map(|w| w.video as i32)),
            Array::i32("frame", vec![t], self.when.iter().map(|w| w.frame as i32)),
            Array::f64("seconds", vec![t], self.when.iter().map(|w| w.time_s.unwrap_or(f64::NAN))),
        ];
        if let Some(colours) = self.colours {
            arrays.push(Array::u8("rgb", vec![n, 3], colours.as_flattened().to_vec()));
        }
        write_npz(path.to_owned(), &arrays)
    }

    /// Writes a CSV file.
    ///
    /// # Errors
    /// A failure of writing; then there is no file.
    pub fn write_csv_file(&self, path: &Path) -> Result<PathBuf, IoError> {
        let mut text = Vec::new();
        self.write_csv(&mut text).map_err(|e| IoError::write(path, e))?;
        let mut file = AtomicFile::create(path.to_owned())?;
        file.put(&text)?;
        file.commit()
    }

    /// Writes CSV.
    ///
    /// # Errors
    /// As `out` has them.
    pub fn write_csv(&self, out: &mut dyn Write) -> std::io::Result<()> {
        writeln!(out, "image,x,y,time,video,frame,seconds,px,py,pz,theta,confidence,moving")?;
        let n = self.pixels.len();
        for (i, [x, y]) in self.pixels.iter().enumerate() {
            for (k, (time, when)) in self.times.iter().zip(self.when).enumerate() {
                let place = &self.positions[3 * (k * n + i)..][..3];
                if place.iter().all(|v| v.is_nan()) {
                    continue;
                }
                let (px, py, pz) = (place[0], place[1], place[2]);
                let seconds = when.time_s.map_or_else(String::new, |s| s.to_string());
                writeln!(
                    out,
                    "{},{x},{y},{time},{},{},{seconds},{px},{py},{pz},{},{},{}",
                    self.image,
                    when.video,
                    when.frame,
                    self.theta[i],
                    self.confidence[i],
                    u8::from(self.moving[i])
                )?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_a_point_and_time() {
        let when = [0, 2].map(|frame| ImageTime { video: 1, frame, time_s: (frame > 0).then_some(0.5) });
        let table = PathTable {
            image: 3,
            times: &[0, 2],
            when: &when,
            pixels: &[[7, 9]],
            positions: &[1.0, 2.0, 0.1, -1.0, 0.0, 4.0],
            confidence: &[1.5],
            theta: &[0.25],
            moving: &[false],
            colours: None,
        };
        let mut text = Vec::new();
        table.write_csv(&mut text).unwrap();
        let lines: Vec<&str> = std::str::from_utf8(&text).unwrap().lines().skip(1).collect();
        assert_eq!(lines, ["3,7,9,0,1,0,,1,2,0.1,0.25,1.5,0", "3,7,9,2,1,2,0.5,-1,0,4,0.25,1.5,0"]);
        let lost = PathTable { positions: &[f32::NAN, f32::NAN, f32::NAN, -1.0, 0.0, 4.0], ..table };
        let mut text = Vec::new();
        lost.write_csv(&mut text).unwrap();
        assert_eq!(std::str::from_utf8(&text).unwrap().lines().skip(1).collect::<Vec<_>>(), lines[1..]);
    }
}
