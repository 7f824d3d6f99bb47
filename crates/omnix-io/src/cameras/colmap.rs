//! COLMAP models, binary and text (COLMAP's documentation, "Output format"; `src/colmap/sensor/models.h` for the lenses).

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};

use super::given::{GivenCamera, GivenCameras, PictureKey, text};
use super::lens::{Distortion, Lens};
use super::pose;
use crate::IoError;

/// The two files of a model that are read.
pub(super) struct Model {
    cameras: PathBuf,
    images: PathBuf,
    binary: bool,
}

/// Whether a file of this name is part of a model.
pub(super) fn is_part(name: &str) -> bool {
    ["cameras.bin", "images.bin", "points3d.bin", "cameras.txt", "images.txt", "points3d.txt"].contains(&name)
}

/// A lens and the size of the pictures that it is for.
type Sensor = (Lens, [u32; 2]);

impl Model {
    /// The model of a folder, if it has one; a binary one before one of text, as COLMAP itself has it.
    pub(super) fn in_folder(folder: &Path) -> Option<Self> {
        [("bin", true), ("txt", false)].into_iter().find_map(|(ending, binary)| {
            let [cameras, images] = ["cameras", "images"].map(|name| folder.join(format!("{name}.{ending}")));
            (cameras.is_file() && images.is_file()).then_some(Self { cameras, images, binary })
        })
    }

    pub(super) fn read(&self) -> Result<GivenCameras, IoError> {
        let cameras = if self.binary {
            let sensors = binary_sensors(&mut Reader::open(&self.cameras)?)?;
            binary_images(&mut Reader::open(&self.images)?, &sensors)?
        } else {
            let sensors = text_sensors(&self.cameras)?;
            text_images(&self.images, &sensors)?
        };
        Ok(GivenCameras { cameras, format: "colmap", path: self.images.clone() })
    }
}

/// COLMAP's models in the order of their numbers: name, and number of parameters.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

/// The lens of a model with these parameters.
fn lens(model: &str, p: &[f64]) -> Result<Lens, String> {
    let wanted = MODELS.iter().find(|(name, _)| *name == model).map(|(_, count)| *count);
    if wanted.is_some_and(|count| count != p.len()) {
        return Err(format!("a {model} camera has {} parameters", wanted.unwrap_or(0)));
    }
    let (focal, centre, rest) = match (model, p) {
        ("SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL", [f, cx, cy, rest @ ..]) => ([*f, *f], [*cx, *cy], rest),
        ("PINHOLE" | "OPENCV" | "FULL_OPENCV", [fx, fy, cx, cy, rest @ ..]) => ([*fx, *fy], [*cx, *cy], rest),
        _ => {
            return Err(format!(
                "a camera of the model {model}, whose distortion cannot be taken out here: undistort with colmap image_undistorter"
            ));
        }
    };
    let distortion = match *rest {
        [] => Distortion::default(),
        [k1] => Distortion { radial: [k1, 0.0, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] },
        [k1, k2] => Distortion { radial: [k1, k2, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] },
        [k1, k2, p1, p2] => Distortion { radial: [k1, k2, 0.0, 0.0, 0.0, 0.0], tangential: [p1, p2] },
        [k1, k2, p1, p2, k3, k4, k5, k6] => Distortion { radial: [k1, k2, k3, k4, k5, k6], tangential: [p1, p2] },
        _ => return Err(format!("a {model} camera with {} parameters", p.len())),
    };
    let lens = Lens { focal, centre: Some(centre), distortion };
    if p.iter().all(|v| v.is_finite()) && focal.iter().all(|f| *f > 0.0) {
        Ok(lens)
    } else {
        Err("a camera whose numbers are not finite, or whose focal length is not above 0".to_owned())
    }
}

fn bad(path: &Path, reason: impl Into<String>) -> IoError {
    IoError::BadCameras { reason: reason.into(), path: path.to_owned() }
}

/// The lines that are no comments, empty ones too, with their numbers from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(k, line)| (k + 1, line.trim())).filter(|(_, line)| !line.starts_with('#'))
}

fn numbers<'a>(fields: impl Iterator<Item = &'a str>) -> Option<Vec<f64>> {
    fields.map(|field| field.parse().ok()).collect()
}

fn text_sensors(path: &Path) -> Result<HashMap<u32, Sensor>, IoError> {
    let text = text(path)?;
    let mut sensors = HashMap::new();
    for (number, line) in lines(&text).filter(|(_, line)| !line.is_empty()) {
        let at = |reason: &str| bad(path, format!("line {number}: {reason}"));
        let mut fields = line.split_whitespace();
        let mut next = || fields.next().ok_or_else(|| at("CAMERA_ID, MODEL, WIDTH, HEIGHT and parameters are needed"));
        let (id, model, width, height) = (next()?, next()?, next()?, next()?);
        let [Ok(id), Ok(width), Ok(height)] = [id, width, height].map(str::parse::<u32>) else {
            return Err(at("CAMERA_ID, WIDTH and HEIGHT are whole numbers"));
        };
        let parameters = numbers(fields).ok_or_else(|| at("a parameter that is no number"))?;
        let lens = lens(model, &parameters).map_err(|reason| at(&reason))?;
        if sensors.insert(id, (lens, [width, height])).is_some() {
            return Err(at("this camera is there twice"));
        }
    }
    Ok(sensors)
}

fn text_images(path: &Path, sensors: &HashMap<u32, Sensor>) -> Result<Vec<GivenCamera>, IoError> {
    let text = text(path)?;
    let mut cameras = Vec::new();
    let mut all = lines(&text);
    while let Some((number, line)) = all.next() {
        if line.is_empty() {
            continue;
        }
        let at = |reason: &str| bad(path, format!("line {number}: {reason}"));
        // A name may have spaces in it.
        let fields: Vec<&str> = line.splitn(10, ' ').collect();
        let (Some(parsed), [_, .., sensor, name]) = (numbers(fields.iter().take(8).copied()), &fields[..]) else {
            return Err(at("QW, QX, QY, QZ, TX, TY and TZ are numbers"));
        };
        let ([_, qw, qx, qy, qz, tx, ty, tz], 10) = (&parsed[..], fields.len()) else {
            return Err(at("IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID and NAME are needed"));
        };
        let sensor = sensor.parse().map_err(|_| at("CAMERA_ID is a whole number"))?;
        let world_to_camera = pose::from_quaternion([*qw, *qx, *qy, *qz], [*tx, *ty, *tz]).map_err(at)?;
        cameras.push(camera(sensors, sensor, name, world_to_camera).map_err(|reason| at(&reason))?);
        // The next line lists the points that the image sees; it is empty where it sees no point.
        if let Some((number, points)) = all.next()
            && !points.split_whitespace().count().is_multiple_of(3)
        {
            return Err(bad(
                path,
                format!("line {number}: X, Y and POINT3D_ID of points are needed, or an empty line"),
            ));
        }
    }
    Ok(cameras)
}

fn camera(
    sensors: &HashMap<u32, Sensor>,
    id: u32,
    name: &str,
    world_to_camera: [[f32; 4]; 3],
) -> Result<GivenCamera, String> {
    let (lens, size) = *sensors.get(&id).ok_or_else(|| format!("camera {id} of {name} is not among the cameras"))?;
    Ok(GivenCamera { picture: PictureKey::Name(name.to_owned()), size: Some(size), lens, world_to_camera })
}

fn binary_sensors(file: &mut Reader) -> Result<HashMap<u32, Sensor>, IoError> {
    let count = file.u64()?;
    let mut sensors = HashMap::new();
    for _ in 0..count {
        let (id, model) = (file.u32()?, file.u32()?);
        let sides = [file.u64()?, file.u64()?].map(u32::try_from);
        let Some((name, parameters)) = MODELS.get(model as usize) else {
            return Err(file.bad(format!("camera {id} is of model {model}, which is not known")));
        };
        let parameters = (0..*parameters).map(|_| file.f64()).collect::<Result<Vec<_>, _>>()?;
        let lens = lens(name, &parameters).map_err(|reason| file.bad(format!("camera {id}: {reason}")))?;
        let [Ok(width), Ok(height)] = sides else {
            return Err(file.bad(format!("camera {id}: a size that no picture has")));
        };
        if sensors.insert(id, (lens, [width, height])).is_some() {
            return Err(file.bad(format!("camera {id} is there twice")));
        }
    }
    Ok(sensors)
}

fn binary_images(file: &mut Reader, sensors: &HashMap<u32, Sensor>) -> Result<Vec<GivenCamera>, IoError> {
    let count = file.u64()?;
    let mut cameras = Vec::new();
    for _ in 0..count {
        let id = file.u32()?;
        let mut next = || file.f64();
        let (q, t) = ([next()?, next()?, next()?, next()?], [next()?, next()?, next()?]);
        let sensor = file.u32()?;
        let name = file.name()?;
        let points = file.u64()?;
        // Two numbers and the point's number, for each.
        file.skip(points.checked_mul(24))?;
        let at = |reason: &str| format!("image {id} ({name}): {reason}");
        let world_to_camera = pose::from_quaternion(q, t).map_err(|reason| file.bad(at(reason)))?;
        cameras.push(camera(sensors, sensor, &name, world_to_camera).map_err(|reason| file.bad(at(&reason)))?);
    }
    Ok(cameras)
}

/// A binary file, read from the front.
struct Reader {
    file: BufReader<File>,
    path: PathBuf,
}

/// Bytes of a picture's name at most.
const LONGEST_NAME: u64 = 4096;

impl Reader {
    fn open(path: &Path) -> Result<Self, IoError> {
        let file = File::open(path).map_err(|error| bad(path, format!("it cannot be opened: {error}")))?;
        Ok(Self { file: BufReader::new(file), path: path.to_owned() })
    }

    fn bad(&self, reason: String) -> IoError {
        bad(&self.path, reason)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], IoError> {
        let mut bytes = [0; N];
        match self.file.read_exact(&mut bytes) {
            Ok(()) => Ok(bytes),
            Err(error) => Err(self.bad(format!("it is cut short ({error})"))),
        }
    }

    fn u32(&mut self) -> Result<u32, IoError> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, IoError> {
        self.array().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, IoError> {
        self.array().map(f64::from_le_bytes)
    }

    /// Passes over bytes. One that lies beyond the end is found out by the next that is read.
    fn skip(&mut self, count: Option<u64>) -> Result<(), IoError> {
        let count = count.and_then(|count| i64::try_from(count).ok());
        let skipped = count.map(|count| self.file.seek_relative(count));
        if matches!(skipped, Some(Ok(()))) { Ok(()) } else { Err(self.bad("it is cut short".to_owned())) }
    }

    /// A text that ends with a zero.
    fn name(&mut self) -> Result<String, IoError> {
        let mut bytes = Vec::new();
        let read = self.file.by_ref().take(LONGEST_NAME).read_until(0, &mut bytes);
        if read.is_err() || bytes.pop() != Some(0) {
            return Err(self.bad("a name without an end".to_owned()));
        }
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}
