//! `omx4d`: `scene.omx4d`, a compact format for web viewers (`omnix.md` section 12, version 1).
//!
//! 8 bytes `OMX4D\r\n\x1a`, u32 version 1, u32 length of the header, the header (UTF-8 JSON, keys sorted, no spaces, numbers
//! written as Python writes them), then six sections, each at the next multiple of 8 and zero padded, little endian:
//! * `positions` f32 [frames, points, 3]
//! * `colors` u8 [points, 3]
//! * `dynamicScore` f32 [points], in 0..1
//! * `sourceView` u16 [points]
//! * `cameraPose` f32 [views, 4, 4], camera-to-world
//! * `intrinsics` f32 [views, 3, 3]
//!
//! Axes: x right, y up, z backward, so y and z are negated and poses are `B c2w B`, B = diag(1,−1,−1,1). Points are chosen by
//! [`super::choose_voxel`] among those offered; they are in the order of their ids, `(source H + y) W + x`.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

use super::{
    atomic::AtomicFile,
    camera::Camera,
    colour,
    format::{FileKind, Format, Points},
    motion::MovingPoints,
    options::{Omx4dOptions, VoxelOptions, check_rate},
    voxel::{VoxelChoice, choose_voxel},
};
use crate::IoError;

const NAME: &str = "scene.omx4d";

pub(super) const FORMAT: Format = Format {
    name: "omx4d",
    needs_cameras: true,
    needs_motion: true,
    files: &[FileKind::one(NAME, "moving points for web viewers: OMX4D version 1, axes x right, y up, z backward")
        .with(Points::Network)],
    disk: |size| size.paths(size.moving().min(100_000), 12, 9),
    memory: |size| size.path_memory(9),
    points: Some(|dir, points, options| {
        Ok(vec![write_omx4d(&dir.join(NAME), &options.name, options.fps, points, &options.omx4d)?])
    }),
    ..Format::NONE
};

const MAGIC: &[u8; 8] = b"OMX4D\r\n\x1a";
const VERSION: u32 = 1;

/// A section of the file.
struct Section {
    name: &'static str,
    dtype: &'static str,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// Writes the file `path`.
///
/// # Errors
/// No points, or points that are no pixels of the images; a frame rate that is not positive; a failure of writing.
pub fn write_omx4d(
    path: &Path,
    name: &str,
    fps: f64,
    points: &MovingPoints,
    options: &Omx4dOptions,
) -> Result<PathBuf, IoError> {
    points.check(FORMAT.name)?;
    check_rate(fps)?;
    let views = points.views.len();
    let candidates = options.candidate_views.map_or(views, |v| v.min(views));
    let (order, choice) = choose(points, candidates, &options.voxel);
    if choice.chosen.is_empty() {
        return Err(IoError::NoPoints { export: FORMAT.name });
    }
    let chosen: Vec<usize> = choice.chosen.iter().map(|&i| order[i]).collect();
    let mut hash = Sha256::new();
    chosen.iter().for_each(|&i| hash.update((id(points, i) as i64).to_le_bytes()));
    let identity = hash.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    });
    let sampling = sampling(&choice, &options.voxel, candidates, views, &identity);
    let (sections, bounds) = sections(points, &chosen, options)?;
    let fields = Fields { name, fps, views, points: chosen.len(), bounds, sampling };
    let (header, offsets) = header(&fields, &sections);

    let mut file = AtomicFile::create(path.to_owned())?;
    let length = u32::try_from(header.len()).expect("BUG: the header is about 1 kB and the name");
    file.put(MAGIC)?;
    file.put(&VERSION.to_le_bytes())?;
    file.put(&length.to_le_bytes())?;
    file.put(header.as_bytes())?;
    let mut at = 16 + header.len();
    for (section, &offset) in sections.iter().zip(&offsets) {
        file.put(&[0; 16][..offset - at])?;
        file.put(&section.bytes)?;
        at = offset + section.bytes.len();
    }
    file.commit()
}

/// Identity of a point: its pixel's number over all images.
fn id(points: &MovingPoints, point: usize) -> u64 {
    let picture = &points.views[0].picture;
    let [x, y] = points.pixel[point].map(u64::from);
    (u64::from(points.source[point]) * u64::from(picture.height) + y) * u64::from(picture.width) + x
}

/// The points in order of identity and the choice among them.
fn choose(points: &MovingPoints, candidate_views: usize, options: &VoxelOptions) -> (Vec<usize>, VoxelChoice) {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by_key(|&i| id(points, i));
    let finite = |i: usize| (0..points.views.len()).all(|t| points.position(t, i).iter().all(|v| v.is_finite()));
    let valid: Vec<bool> = order.iter().map(|&i| (points.source[i] as usize) < candidate_views && finite(i)).collect();
    let scores: Vec<f32> = order.iter().map(|&i| points.motion[i]).collect();
    let first: Vec<f32> = order.iter().flat_map(|&i| points.position(0, i)).collect();
    let choice = choose_voxel(&scores, &first, &valid, options);
    (order, choice)
}

fn sampling(choice: &VoxelChoice, options: &VoxelOptions, candidates: usize, views: usize, identity: &str) -> String {
    let selected = choice.chosen.len();
    let cutoff = choice.cutoff.map_or_else(|| "null".to_owned(), |c| python_float(f64::from(c)));
    format!(
        "{{\"candidateSourceViewCount\":{candidates},\"dynamicRanking\":\"global-descending-stable-identity-tiebreak\",\
         \"dynamicReservedFraction\":{},\"dynamicScoreCutoff\":{cutoff},\"dynamicSelectedPointCount\":{},\
         \"dynamicThreshold\":{},\"excludedPaddedSourceViewCount\":{},\"identityHash\":\"{identity}\",\
         \"method\":\"dynamic-reserved-voxel-v1\",\"requestedPointCount\":{},\"selectedPointCount\":{selected},\
         \"spatialDistribution\":\"normalized-frame-zero-3d-voxel\",\"spatialSelectedPointCount\":{},\
         \"validCandidateCount\":{}}}",
        python_float(options.reserve),
        choice.dynamic,
        python_float(options.threshold),
        views - candidates,
        options.budget,
        selected - choice.dynamic,
        choice.valid,
    )
}

/// Smallest and largest coordinate of each axis.
type Bounds = [[f32; 3]; 2];

fn sections(
    points: &MovingPoints,
    chosen: &[usize],
    options: &Omx4dOptions,
) -> Result<(Vec<Section>, Bounds), IoError> {
    let (views, n) = (points.views.len(), chosen.len());
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    let mut positions = Vec::with_capacity(12 * views * n);
    for time in 0..views {
        for &i in chosen {
            let [x, y, z] = points.position(time, i);
            for (axis, v) in [x, -y, -z].into_iter().enumerate() {
                bounds[0][axis] = bounds[0][axis].min(v);
                bounds[1][axis] = bounds[1][axis].max(v);
                positions.extend(v.to_le_bytes());
            }
        }
    }
    let scores: Vec<f32> = chosen.iter().map(|&i| points.motion[i].clamp(0.0, 1.0)).collect();
    let colours = chosen
        .iter()
        .zip(&scores)
        .flat_map(|(&i, &score)| if options.palette { palette(points.source[i], score) } else { points.colours[i] });
    let mut sources = Vec::with_capacity(2 * n);
    for &i in chosen {
        let reason = "the format counts images in 16 bits";
        let source = u16::try_from(points.source[i]).map_err(|_too_large| IoError::BadPoint {
            export: FORMAT.name,
            point: i,
            reason,
        })?;
        sources.extend(source.to_le_bytes());
    }
    let poses = poses(points, options)?;
    let intrinsics = points.views.iter().flat_map(|v| v.intrinsics).flatten().flat_map(f32::to_le_bytes).collect();
    let section = |name, dtype, shape, bytes| Section { name, dtype, shape, bytes };
    let sections = vec![
        section("positions", "float32", vec![views, n, 3], positions),
        section("colors", "uint8", vec![n, 3], colours.collect()),
        section("dynamicScore", "float32", vec![n], scores.iter().flat_map(|s| s.to_le_bytes()).collect()),
        section("sourceView", "uint16", vec![n], sources),
        section("cameraPose", "float32", vec![views, 4, 4], poses.into_iter().flat_map(f32::to_le_bytes).collect()),
        section("intrinsics", "float32", vec![views, 3, 3], intrinsics),
    ];
    Ok((sections, bounds))
}

/// `B c2w B` of every image.
fn poses(points: &MovingPoints, options: &Omx4dOptions) -> Result<Vec<f32>, IoError> {
    const AXES: [f32; 4] = [1.0, -1.0, -1.0, 1.0];
    let mut poses = Vec::with_capacity(16 * points.views.len());
    for (index, view) in points.views.iter().enumerate() {
        let given = options.camera_to_world.as_ref().and_then(|all| all.get(index)).copied();
        let missing = IoError::MissingField { export: FORMAT.name, missing: "an invertible camera", index };
        let pose = match given {
            Some(pose) => pose,
            None => {
                let (r, c) = Camera::new(view.extrinsics, view.intrinsics).ok_or(missing)?.camera_to_world();
                let rows = r.transpose().to_cols_array_2d();
                std::array::from_fn(|i| [rows[i][0] as f32, rows[i][1] as f32, rows[i][2] as f32, c[i] as f32])
            }
        };
        for (i, row) in pose.into_iter().chain([[0.0, 0.0, 0.0, 1.0]]).enumerate() {
            // Adding zero turns a negative zero into a positive one, as a product of matrices does.
            poses.extend((0..4).map(|j| AXES[i] * row[j] * AXES[j] + 0.0));
        }
    }
    Ok(poses)
}

/// A hue for each source image, in 8 bits, blended towards red by motion.
fn palette(source: u32, score: f32) -> [u8; 3] {
    const MOVING: [f64; 3] = [255.0, 72.0, 86.0];
    let base = colour::hsv((0.08 + 0.618_033_988_749_894_9 * f64::from(source)) % 1.0, 0.62, 0.95);
    let share = 0.45 * f64::from(score);
    std::array::from_fn(|c| (f64::from(base[c]) * (1.0 - share) + MOVING[c] * share).round_ties_even() as u8)
}

/// What the header says beside the sections.
struct Fields<'a> {
    name: &'a str,
    fps: f64,
    views: usize,
    points: usize,
    bounds: Bounds,
    sampling: String,
}

/// The header and the sections' offsets, which depend on its length and stand in it.
fn header(fields: &Fields<'_>, sections: &[Section]) -> (String, Vec<usize>) {
    let mut start = 0;
    loop {
        let mut at = start;
        let offsets: Vec<usize> = sections
            .iter()
            .map(|s| {
                let offset = at;
                at = (offset + s.bytes.len()).next_multiple_of(8);
                offset
            })
            .collect();
        let text = header_with(fields, sections, &offsets);
        let end = (16 + text.len()).next_multiple_of(8);
        if end <= start {
            return (text, offsets);
        }
        start = end;
    }
}

fn header_with(fields: &Fields<'_>, sections: &[Section], offsets: &[usize]) -> String {
    let mut attributes: Vec<(&str, String)> = sections
        .iter()
        .zip(offsets)
        .map(|(s, offset)| {
            let shape: Vec<String> = s.shape.iter().map(ToString::to_string).collect();
            let (bytes, dtype) = (s.bytes.len(), s.dtype);
            let text = format!(
                "\"{}\":{{\"byteLength\":{bytes},\"dtype\":\"{dtype}\",\"offset\":{offset},\"shape\":[{}]}}",
                s.name,
                shape.join(",")
            );
            (s.name, text)
        })
        .collect();
    attributes.sort_by_key(|(name, _)| *name);
    let attributes: Vec<String> = attributes.into_iter().map(|(_, text)| text).collect();
    let corner = |c: [f32; 3]| c.map(|v| python_float(f64::from(v))).join(",");
    format!(
        "{{\"attributes\":{{{}}},\"bounds\":{{\"max\":[{}],\"min\":[{}]}},\
         \"coordinateSystem\":\"threejs-right-handed-y-up\",\"durationSeconds\":{},\"fps\":{},\"frameCount\":{views},\
         \"name\":{},\"pointCount\":{},\"primitive\":\"points\",\"sampling\":{},\"schemaVersion\":1,\
         \"sourceViewCount\":{views},\"units\":\"unknown\",\"warnings\":[]}}",
        attributes.join(","),
        corner(fields.bounds[1]),
        corner(fields.bounds[0]),
        python_float(fields.views as f64 / fields.fps),
        python_float(fields.fps),
        serde_json::Value::from(fields.name),
        fields.points,
        fields.sampling,
        views = fields.views,
    )
}

/// A finite number as Python's `repr` writes it: the shortest digits that give it back, of two equally near ones the even, an exponent
/// of at least two digits below 1e-4 and from 1e16 on.
fn python_float(value: f64) -> String {
    let shortest = format!("{value:e}");
    let Some((mantissa, exponent)) = shortest.split_once('e') else { return shortest };
    let Ok(exponent) = exponent.parse::<i32>() else { return shortest };
    let sign = if mantissa.starts_with('-') { "-" } else { "" };
    let mut digits = plain_digits(mantissa);
    // No f64 has more digits than these. Rust rounds ties up.
    let exact = plain_digits(format!("{value:.800e}").split('e').next().unwrap_or_default());
    let exact = exact.trim_end_matches('0');
    if let Some(below) = exact.strip_suffix('5')
        && below.len() == digits.len()
        && below.ends_with(['0', '2', '4', '6', '8'])
        && format!("{sign}0.{below}e{}", exponent + 1).parse() == Ok(value)
    {
        digits = below.to_owned();
    }
    match exponent {
        0..16 => {
            let whole = exponent as usize + 1;
            digits.extend(std::iter::repeat_n('0', (whole + 1).saturating_sub(digits.len())));
            let (whole, part) = digits.split_at(whole);
            format!("{sign}{whole}.{part}")
        }
        -4..0 => format!("{sign}0.{}{digits}", "0".repeat((-exponent - 1) as usize)),
        _ => {
            let (first, more) = digits.split_at(1);
            let point = if more.is_empty() { "" } else { "." };
            let direction = if exponent < 0 { '-' } else { '+' };
            format!("{sign}{first}{point}{more}e{direction}{:02}", exponent.abs())
        }
    }
}

/// The digits of a number without sign and point.
fn plain_digits(mantissa: &str) -> String {
    mantissa.chars().filter(char::is_ascii_digit).collect()
}

#[cfg(test)]
mod tests {
    use super::python_float;

    #[test]
    fn numbers_as_python_writes_them() {
        let numbers = [12.0, 0.25, 1e-4, 1.5e-5, 1e-7, 1e15, 1e16, 1.25e22, 0.0, -3.5, 1e-300].map(python_float);
        let expected =
            ["12.0", "0.25", "0.0001", "1.5e-05", "1e-07", "1000000000000000.0", "1e+16", "1.25e+22", "0.0", "-3.5"];
        assert_eq!(numbers[..10], expected);
        assert_eq!(numbers[10], "1e-300");
        // Halfway between two numbers of as many digits.
        assert_eq!(python_float(f64::from(3.132_087_7f32)), "3.1320877075195312");
        assert_eq!([0.001, 100.0, -0.0, 123.456].map(python_float), ["0.001", "100.0", "-0.0", "123.456"]);
    }
}
