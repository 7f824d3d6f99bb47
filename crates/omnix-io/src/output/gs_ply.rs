//! `gs_ply`: the Gaussians of all images in one file, `gs_ply/0000.ply`, in the layout of 3D Gaussian splatting as Depth Anything 3 writes
//! it (`da3.md` section 15).
//!
//! Vertex, 17 floats, little endian: x y z, nx ny nz (0), f_dc_0..2 (degree 0 of the colours), opacity (before the sigmoid), scale_0..2
//! (logarithms), rot_0..3. Left out, as there: a border of floor(8/256 of the side) pixels, and in each image what is farther than its
//! 90 % quantile of depth; and the sky. Positions are in the world of the extrinsics, in the run's unit. Gaussians are spooled to an
//! unnamed file, because their number is known only at the end.

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use omnix_geometry::{Camera, Gaussian, GaussianMaps};

use super::{
    atomic::{AtomicFile, Spool},
    format::{FileKind, Format, Points},
    frame::{FrameResult, RunSummary, Sink},
    options::SinkOptions,
    sample::percentile,
};
use crate::IoError;

const NAME: &str = "gs_ply/0000.ply";

pub(super) const FORMAT: Format = Format {
    name: "gs_ply",
    needs_cameras: true,
    needs_gaussians: true,
    files: &[FileKind::one(
        NAME,
        "Gaussians of all images in the world of the extrinsics, for viewers of 3D Gaussian splatting: x y z, normals of 0, f_dc, opacity, scale, rot",
    )
    .with(Points::DepthAndCamera)],
    disk: |size| size.all().saturating_mul(2 * RECORD as u64),
    frames: Some(|dir, options| Ok(Box::new(GsPlySink::new(dir, options)?))),
    ..Format::NONE
};

/// The properties of a vertex, in order.
const PROPERTIES: &str = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
/// Bytes of a vertex.
const RECORD: usize = 17 * size_of::<f32>();
/// The border that is left out is this share of a side.
const BORDER: [u32; 2] = [8, 256];
/// What is farther than this percentile of an image's depth is left out.
const FAR: f32 = 90.0;

struct GsPlySink {
    path: PathBuf,
    unit: String,
    gaussians: Spool,
    images: usize,
}

impl GsPlySink {
    fn new(dir: &Path, options: &SinkOptions) -> Result<Self, IoError> {
        let path = dir.join(NAME);
        let gaussians = Spool::new(dir, path.clone())?;
        Ok(Self { path, unit: options.unit.clone(), gaussians, images: 0 })
    }
}

impl Sink for GsPlySink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        let export = FORMAT.name;
        frame.check(export)?;
        let missing = |missing| IoError::MissingField { export, missing, index: frame.index };
        let numbers = frame.gaussians.ok_or_else(|| missing("Gaussians"))?;
        let extrinsics = frame.extrinsics.ok_or_else(|| missing("extrinsics"))?;
        let intrinsics = frame.intrinsics.ok_or_else(|| missing("intrinsics"))?;
        let (width, height) = (frame.width, frame.height);
        let size = [height as usize, width as usize];
        let maps = GaussianMaps { numbers, depth: frame.depth, size, camera: Camera { extrinsics, intrinsics } };
        let mut sorted: Vec<f32> =
            frame.depth.iter().copied().filter(|depth| depth.is_finite() && *depth > 0.0).collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let far = percentile(&sorted, FAR).unwrap_or(0.0);
        let inside = |at: u32, side: u32| {
            let border = side * BORDER[0] / BORDER[1];
            (border..side - border).contains(&at)
        };
        let gaussians = maps.world().map_err(|_| missing("an invertible camera"))?;
        for (at, gaussian) in gaussians.enumerate() {
            let (row, column) = (at as u32 / width, at as u32 % width);
            let near = frame.depth[at] > 0.0 && frame.depth[at] <= far && !frame.sky.is_some_and(|sky| sky[at]);
            let record = record(&gaussian);
            if inside(row, height) && inside(column, width) && near && record.iter().all(|v| v.is_finite()) {
                self.gaussians.put(bytemuck::cast_slice(&record.map(f32::to_le_bytes)))?;
            }
        }
        self.images += 1;
        Ok(())
    }

    fn finish(self: Box<Self>, summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        let Self { path, unit, gaussians, images } = *self;
        if images == 0 {
            return Ok(Vec::new());
        }
        let count = gaussians.len() / RECORD as u64;
        let mut spool = gaussians.into_reader()?;
        let mut file = AtomicFile::create(path.clone())?;
        file.put(header(count, &unit, summary).as_bytes())?;
        let mut record = [0u8; RECORD];
        for _ in 0..count {
            spool.read_exact(&mut record).map_err(|e| IoError::read(&path, e))?;
            file.put(&record)?;
        }
        Ok(vec![file.commit()?])
    }
}

/// The numbers of a vertex.
fn record(gaussian: &Gaussian) -> [f32; 17] {
    let Gaussian { mean: [x, y, z], scale, rotation: [a, b, c, d], harmonics, density } = *gaussian;
    let [r, g, blue] = harmonics.map(|colour| colour[0]);
    let [s, t, u] = scale.map(f32::ln);
    [x, y, z, 0.0, 0.0, 0.0, r, g, blue, density, s, t, u, a, b, c, d]
}

fn header(count: u64, unit: &str, summary: &RunSummary) -> String {
    let unit = unit.replace(['\n', '\r'], " ");
    let mut text = format!(
        "ply\nformat binary_little_endian 1.0\ncomment omnix: Gaussians of all images\n\
         comment world frame: that of the extrinsics (world-to-camera) of the same run; OpenCV axes, x right, y down, z forward\n\
         comment unit of length: {unit}\n"
    );
    if summary.interrupted {
        text.push_str("comment the run was interrupted: these are the images finished until then\n");
    }
    text.push_str(&format!("element vertex {count}\n"));
    PROPERTIES.split(' ').for_each(|name| text.push_str(&format!("property float {name}\n")));
    text.push_str("end_header\n");
    text
}
