//! The file of a field, `field.safetensors`: any safetensors reader opens it.
//!
//! T images (and target times), H × W pixels, L = rows · columns cells of the grid, M levels, Q points per level.
//!
//! | tensor | type | shape | |
//! |---|---|---|---|
//! | `field` | F32 or F16 | T source, M, T target, L, 9 | six numbers of rotation, three of translation |
//! | `mask` | F32 | T, L | which cells were chosen (0 or 1; the score, where the network samples that) |
//! | `offsets` | F32 or F16 | T, H, W, M, Q, 2 | where a pixel samples, in cells from its own place: x, y |
//! | `weights` | F32 or F16 | T, H, W, M, Q | of its samples, sum 1; all 0 where a mask holds the pixel still |
//! | `points` | F32 or F16 | T, H, W, 3 | world points at the image's own time; NaN where a mask leaves the pixel out |
//! | `theta`, `confidence` | F32 | T, H, W | motion score; confidence of the paths, at least 1, or 0 where a mask leaves the pixel out |
//! | `extrinsics`, `intrinsics` | F32 | T, 3, 4; T, 3, 3 | world-to-camera, OpenCV axes; in pixels of the processed image |
//! | `times` | U32 | T, 2 | video and frame of each image |
//! | `seconds` | F64 | T | from the start of its video; NaN where unknown (F32 in files of version 1) |
//! | `pictures` | U32 | T, H, W | red + 256 green + 65536 blue; only if there are pictures |
//!
//! `__metadata__`: `format`, `version` (`omnix_io::output::field`), `shape` and `motion` (JSON), `network`, `weights`, `unit`, `note`;
//! of the field of a film's window also `window`, the window's digest.
//! An F32 file gives back the very bits; F16 rounds, so that a score near the gate's threshold may fall on its other side.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use omnix_geometry::Camera;
use omnix_graph::ops::{Gate, Motion};
use omnix_io::IoError;
use omnix_io::output::field::{Dtype, FieldReader, FieldWriter, TensorSpec};
use omnix_model::PATCH;
use pollster::block_on;
use serde_json::{Value, json};

use super::file::MapsFile;
use super::shape::PARTS;
use super::{About, Field, FieldImage, FieldShape, Maps, Part, Store};
use crate::engine::Engine;
use crate::error::OmnixError;

/// Type of a saved field's large tensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FieldPrecision {
    /// 32 bits: trajectories of the opened field are the same bits.
    #[default]
    F32,
    /// 16 bits: half the size.
    F16,
}

impl FieldPrecision {
    const fn of(self, part: Part) -> Dtype {
        match (self, part) {
            (Self::F16, Part::Field | Part::Offsets | Part::Weights | Part::Points) => Dtype::F16,
            _ => Dtype::F32,
        }
    }

    /// Bytes of the file of a field of this shape, without its header.
    #[must_use]
    pub fn bytes(self, shape: &FieldShape) -> u64 {
        let parts = PARTS.iter().map(|p| shape.numbers(*p) * self.of(*p).size()).sum::<usize>();
        // θ, confidence and picture of a pixel; camera and time of an image.
        (shape.images * (parts + 12 * shape.pixels() + 100)) as u64
    }
}

impl Field {
    /// Writes `path` one image's part at a time; the file has its name only when whole. A part with a finite number beyond f16 is
    /// stored as F32 whatever the precision.
    ///
    /// # Errors
    /// A failure of writing, of the device, or of reading a spool file.
    pub fn save(&self, path: &Path, precision: FieldPrecision) -> Result<PathBuf, OmnixError> {
        let mut types = PARTS.map(|part| precision.of(part));
        loop {
            match self.write(path, &types) {
                // Such a number is rare, so it is not looked for beforehand, which would read everything twice.
                Err(OmnixError::Io(IoError::FieldDoesNotFit { name, .. }))
                    if PARTS.iter().any(|part| part.name() == name && types[*part as usize] == Dtype::F16) =>
                {
                    PARTS.iter().filter(|part| part.name() == name).for_each(|part| types[*part as usize] = Dtype::F32);
                }
                done => return done,
            }
        }
    }

    fn write(&self, path: &Path, types: &[Dtype; PARTS.len()]) -> Result<PathBuf, OmnixError> {
        let shape = *self.shape();
        let (images, pixels) = (shape.images, [shape.images, shape.height, shape.width]);
        let pictures = self.have_pictures();
        let mut specs: Vec<TensorSpec> = PARTS
            .into_iter()
            .map(|part| {
                let dims: Vec<usize> = [vec![images], shape.dims(part)].concat();
                TensorSpec::new(part.name(), types[part as usize], dims)
            })
            .collect();
        let f32s = |name, dims: &[usize]| TensorSpec::new(name, Dtype::F32, dims);
        specs.extend([f32s("theta", &pixels), f32s("confidence", &pixels)]);
        specs.extend([f32s("extrinsics", &[images, 3, 4]), f32s("intrinsics", &[images, 3, 3])]);
        specs.extend([
            TensorSpec::new("times", Dtype::U32, [images, 2]),
            TensorSpec::new("seconds", Dtype::F64, [images]),
        ]);
        if pictures {
            specs.push(TensorSpec::new("pictures", Dtype::U32, pixels));
        }
        let mut file = FieldWriter::create(path, &specs, &self.metadata())?;
        for part in PARTS {
            for image in 0..images {
                file.write(part.name(), &block_on(self.store.numbers(image, part))?)?;
            }
        }
        let all = self.images();
        (0..images).try_for_each(|i| Ok::<_, OmnixError>(file.write("theta", &self.theta(i)?)?))?;
        (0..images).try_for_each(|i| Ok::<_, OmnixError>(file.write("confidence", &self.confidence(i)?)?))?;
        all.iter().try_for_each(|i| file.write("extrinsics", i.camera.extrinsics.as_flattened()))?;
        all.iter().try_for_each(|i| file.write("intrinsics", i.camera.intrinsics.as_flattened()))?;
        all.iter().try_for_each(|i| file.write_u32("times", &[i.video, i.frame]))?;
        all.iter().try_for_each(|i| file.write_f64("seconds", &[i.time_s.unwrap_or(f64::NAN)]))?;
        for image in 0..if pictures { images } else { 0 } {
            let Some(picture) = self.picture(image)? else { continue };
            let packed = picture.data.as_chunks::<3>().0.iter().map(|&[r, g, b]| u32::from_le_bytes([r, g, b, 0]));
            file.write_u32("pictures", &packed.collect::<Vec<u32>>())?;
        }
        Ok(file.finish()?)
    }

    fn metadata(&self) -> BTreeMap<String, String> {
        let about = self.about();
        let mut metadata = BTreeMap::from([
            ("shape".to_owned(), json!(self.shape()).to_string()),
            ("motion".to_owned(), motion_json(self.motion()).to_string()),
            ("network".to_owned(), about.network.clone()),
            ("weights".to_owned(), about.weights.clone()),
            ("unit".to_owned(), about.unit.clone()),
        ]);
        for (name, said) in [("note", &about.note), (WINDOW, &about.window)] {
            metadata.extend(said.iter().map(|said| (name.to_owned(), said.clone())));
        }
        metadata
    }

    /// Opens a saved field. What is asked for is read when it is asked for, and one image at a time goes to the device.
    ///
    /// # Errors
    /// A file that is absent, of another kind or version, cut short, or whose tensors contradict each other.
    pub fn open(engine: &Engine, path: &Path) -> Result<Self, OmnixError> {
        let file = FieldReader::open(path)?;
        let said = |file: &FieldReader, name: &str| file.metadata(name).unwrap_or_default().to_owned();
        let not = |what: &str| IoError::NotAField { reason: format!("its {what} is not known"), path: path.to_owned() };
        // A header may be long; parsed as JSON these would take many times as much.
        let short = |name: &str| file.metadata(name).filter(|text| text.len() <= LONGEST).unwrap_or_default();
        let shape: FieldShape = serde_json::from_str(short("shape")).map_err(|_syntax| not("shape"))?;
        if !sound(&shape) {
            return Err(not("shape").into());
        }
        let motion = serde_json::from_str(short("motion")).ok().and_then(|m| motion_from(&m));
        let motion = motion.ok_or_else(|| not("motion"))?;
        for part in PARTS {
            file.expect_shape(part.name(), &[vec![shape.images], shape.dims(part)].concat())?;
        }
        let about = About {
            network: said(&file, "network"),
            weights: said(&file, "weights"),
            unit: said(&file, "unit"),
            note: file.metadata("note").map(str::to_owned),
            window: file.metadata(WINDOW).map(str::to_owned),
        };
        let known = known(&file, &shape)?;
        let pictures = file.has("pictures");
        let file = Arc::new(file);
        let store = Store::saved(engine.gpu(), shape, Arc::clone(&file));
        let maps = Maps::Saved(Box::new(MapsFile { file, pictures }));
        Ok(Self::new(engine, (shape, motion), store, None, (known, maps), about))
    }
}

/// In the metadata of the field of a film's window: the window's digest.
pub(crate) const WINDOW: &str = "window";
/// Bytes of a JSON text in the metadata; ours have about a hundred.
const LONGEST: usize = 4096;

/// Whether sizes are positive and small enough to be counted, and the grid is one of the image's patches.
fn sound(shape: &FieldShape) -> bool {
    let FieldShape { images, height, width, grid, levels, points } = *shape;
    let sizes = [images, height, width, grid[0], grid[1], levels, points];
    sizes.iter().all(|n| (1..=1 << 16).contains(n))
        && sizes.iter().map(|n| (*n as f64).log2()).sum::<f64>() < 60.0
        // A pixel's index has 32 bits.
        && height * width < 1 << 31
        && [height, width] == grid.map(|n| n * PATCH)
}

/// What is known of each image; the sizes of what is known of pixels are checked.
fn known(file: &FieldReader, shape: &FieldShape) -> Result<Vec<FieldImage>, OmnixError> {
    let count = shape.images;
    let pixels = [count, shape.height, shape.width];
    file.expect_shape("theta", &pixels)?;
    file.expect_shape("confidence", &pixels)?;
    file.expect_shape("extrinsics", &[count, 3, 4])?;
    file.expect_shape("intrinsics", &[count, 3, 3])?;
    file.expect_shape("times", &[count, 2])?;
    file.expect_shape("seconds", &[count])?;
    if file.has("pictures") {
        file.expect_shape("pictures", &pixels)?;
    }
    let (extrinsics, intrinsics) = (file.read("extrinsics", 0..12 * count)?, file.read("intrinsics", 0..9 * count)?);
    let (times, seconds) = (file.read_u32("times", 0..2 * count)?, file.read_f64("seconds", 0..count)?);
    let image = |i: usize| FieldImage {
        video: times[2 * i],
        frame: times[2 * i + 1],
        time_s: (!seconds[i].is_nan()).then_some(seconds[i]),
        camera: Camera {
            extrinsics: std::array::from_fn(|r| std::array::from_fn(|c| extrinsics[12 * i + 4 * r + c])),
            intrinsics: std::array::from_fn(|r| std::array::from_fn(|c| intrinsics[9 * i + 3 * r + c])),
        },
    };
    Ok((0..count).map(image).collect())
}

/// As configurations write it.
fn motion_json(motion: Motion) -> Value {
    let (gate, threshold) = match motion.gate {
        Gate::None => ("none", None),
        Gate::Hard(threshold) => ("hard", Some(threshold)),
        Gate::Blend => ("blend", None),
    };
    json!({
        "relative_to_own_time": motion.relative, "rotation_min_norm": motion.min_norm, "gate": gate, "threshold": threshold,
    })
}

fn motion_from(value: &Value) -> Option<Motion> {
    // A float's shortest decimal gives back its bits.
    let number = |name: &str| value[name].as_f64().map(|v| v as f32);
    let gate = match value["gate"].as_str()? {
        "none" => Gate::None,
        "hard" => Gate::Hard(number("threshold")?),
        "blend" => Gate::Blend,
        _ => return None,
    };
    Some(Motion { relative: value["relative_to_own_time"].as_bool()?, min_norm: number("rotation_min_norm")?, gate })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_survives_its_text() {
        for gate in [Gate::None, Gate::Hard(0.3), Gate::Blend] {
            let motion = Motion { relative: gate == Gate::Blend, min_norm: 1e-3, gate };
            let text = motion_json(motion).to_string();
            assert_eq!(motion_from(&serde_json::from_str(&text).unwrap()), Some(motion), "{text}");
        }
        assert_eq!(motion_from(&json!({ "gate": "soft" })), None);
    }

    #[test]
    fn shapes_beyond_counting_are_not_sound() {
        let shape = FieldShape { images: 2, height: 14, width: 14, grid: [1, 1], levels: 1, points: 1 };
        assert!(sound(&shape) && !sound(&FieldShape { images: 0, ..shape }));
        assert!(!sound(&FieldShape { images: 1 << 16, height: 1 << 16, width: 1 << 16, levels: 1 << 16, ..shape }));
        assert!(!sound(&FieldShape { height: 14 << 12, width: 14 << 12, grid: [1 << 12; 2], ..shape }));
        assert!(!sound(&FieldShape { height: 15, ..shape }) && !sound(&FieldShape { grid: [2, 1], ..shape }));
    }
}
