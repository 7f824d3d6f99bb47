//! The field of a film in windows: `field.safetensors`, which joins the fields of the windows that lie beside it.
//!
//! T images of the film, K windows, H × W pixels.
//!
//! | tensor | type | shape | |
//! |---|---|---|---|
//! | `windows` | U32 | K, 4 | first image, image after the last, shot, part |
//! | `keys` | U32 | K, 8 | digest of each window, as its field states it (`window` in its metadata, 32 bytes) |
//! | `to_part` | F64 | K, 13 | from the window's world to its part's: scale, rotation by rows, translation |
//! | `extrinsics`, `intrinsics` | F32 | T, 3, 4; T, 3, 3 | world-to-camera in the part's world; in pixels of the processed image |
//! | `times` | U32 | T, 2 | video and frame of each image |
//! | `seconds` | F64 | T | from the start of its video; NaN where unknown |
//! | `pictures` | U32 | T, H, W | red + 256 green + 65536 blue |
//!
//! `__metadata__`: `format` (`omnix-film-field`), `version`, `network`, `weights`, `unit`, `note`. The field of window k is `field/NNNNNN.safetensors` in the
//! same folder, in its own world: a saved field as any other (`field/saved.rs`). Nothing in memory grows with the film but a hundred bytes
//! an image.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use omnix_geometry::{Camera, Similarity};
use omnix_io::{IoError, Picture};
use omnix_tensors::{AtomicFile, Dtype, TensorReader, TensorSpec, TensorWriter};

use super::chain::{Chain, Placement};
use super::follow::Follow;
use super::layout::{Layout, Window};
use super::stored::{StoredWindow, field_path, window_path};
use crate::engine::Engine;
use crate::error::OmnixError;
use crate::field::{About, Field, FieldImage, FieldPrecision, PixelValues, Pixels};

const FORMAT: &str = "omnix-film-field";
const VERSION: &str = "1";
/// The folder, beside the file, of the windows' fields.
const FOLDER: &str = "field";

/// A film whose windows' fields are kept, to be saved with what joins them.
#[derive(Clone, Copy, Debug)]
pub struct FilmFiles<'a> {
    /// The device.
    pub engine: &'a Engine,
    /// The windows.
    pub layout: &'a Layout,
    /// Their places.
    pub chain: &'a Chain,
    /// Where their files are.
    pub folder: &'a Path,
    /// Height and width of an image.
    pub size: [usize; 2],
    /// Times of the film's images, and their cameras in the worlds of their parts.
    pub images: &'a [FieldImage],
    /// Where the film comes from.
    pub about: &'a About,
}

impl FilmFiles<'_> {
    /// Writes `field.safetensors` into `dir`, and the windows' fields into a folder beside it: the very files where the file system can give a
    /// file two names, else copies. `each` is called before each window.
    ///
    /// # Errors
    /// A failure of reading or writing, of `pictures`, or of `each`. Files are whole or not there.
    pub fn save(
        &self,
        dir: &Path,
        precision: FieldPrecision,
        pictures: &mut dyn FnMut(usize) -> Result<Picture, OmnixError>,
        each: &mut dyn FnMut(usize) -> Result<(), OmnixError>,
    ) -> Result<Vec<PathBuf>, OmnixError> {
        let count = self.layout.windows().len();
        let (mut written, mut keys) = (Vec::with_capacity(count + 1), Vec::with_capacity(8 * count));
        for k in 0..count {
            each(k)?;
            keys.extend(digest(StoredWindow::open(&window_path(self.folder, k), self.size)?.key()));
            let (from, to) = (field_path(self.folder, k), window_path(&dir.join(FOLDER), k));
            match precision {
                FieldPrecision::F32 => share(&from, &to)?,
                FieldPrecision::F16 => Field::open(self.engine, &from)?.save(&to, precision).map(drop)?,
            }
            written.push(to);
        }
        // Last, so that it never names a file that is not there.
        written.push(self.write(&dir.join("field.safetensors"), &keys, pictures)?);
        Ok(written)
    }

    fn write(
        &self,
        path: &Path,
        keys: &[u32],
        pictures: &mut dyn FnMut(usize) -> Result<Picture, OmnixError>,
    ) -> Result<PathBuf, OmnixError> {
        let (images, [height, width]) = (self.images.len(), self.size);
        let count = self.layout.windows().len();
        let specs = [
            TensorSpec::new("windows", Dtype::U32, [count, 4]),
            TensorSpec::new("keys", Dtype::U32, [count, 8]),
            TensorSpec::new("to_part", Dtype::F64, [count, 13]),
            TensorSpec::new("extrinsics", Dtype::F32, [images, 3, 4]),
            TensorSpec::new("intrinsics", Dtype::F32, [images, 3, 3]),
            TensorSpec::new("times", Dtype::U32, [images, 2]),
            TensorSpec::new("seconds", Dtype::F64, [images]),
            TensorSpec::new("pictures", Dtype::U32, [images, height, width]),
        ];
        let About { network, weights, unit, note, .. } = self.about;
        let said =
            [("format", FORMAT), ("version", VERSION), ("network", network), ("weights", weights), ("unit", unit)];
        let said = said.into_iter().chain(note.iter().map(|note| ("note", note.as_str())));
        let metadata = said.map(|(name, text)| (name.to_owned(), text.to_owned())).collect::<BTreeMap<_, _>>();
        let mut file = TensorWriter::create(path, &specs, &metadata).map_err(OmnixError::Window)?;
        let mut put = || -> Result<(), omnix_tensors::TensorError> {
            for (window, place) in self.layout.windows().iter().zip(self.chain.placements()) {
                let range = &window.images;
                let numbers = [range.start, range.end, window.shot, place.part].map(|n| n as u32);
                file.write_u32("windows", &numbers)?;
            }
            file.write_u32("keys", keys)?;
            for place in self.chain.placements() {
                let Similarity { scale, rotation, translation } = &place.to_part;
                file.write_f64("to_part", &[&[*scale], rotation.as_flattened(), translation].concat())?;
            }
            let all = self.images;
            all.iter().try_for_each(|i| file.write_f32("extrinsics", i.camera.extrinsics.as_flattened()))?;
            all.iter().try_for_each(|i| file.write_f32("intrinsics", i.camera.intrinsics.as_flattened()))?;
            all.iter().try_for_each(|i| file.write_u32("times", &[i.video, i.frame]))?;
            all.iter().try_for_each(|i| file.write_f64("seconds", &[i.time_s.unwrap_or(f64::NAN)]))
        };
        put().map_err(OmnixError::Window)?;
        for image in 0..images {
            let colours = pictures(image)?.data;
            let packed = colours.as_chunks::<3>().0.iter().map(|&[r, g, b]| u32::from_le_bytes([r, g, b, 0]));
            file.write_u32("pictures", &packed.collect::<Vec<u32>>()).map_err(OmnixError::Window)?;
        }
        file.finish().map_err(OmnixError::Window)
    }
}

/// The 32 bytes of a digest such as `blake3:00ff...`; zeros where the text is not one.
fn digest(key: &str) -> [u32; 8] {
    let hash = key.strip_prefix("blake3:").and_then(|hex| blake3::Hash::from_hex(hex).ok());
    let bytes = hash.map_or([0; 32], |hash| *hash.as_bytes());
    std::array::from_fn(|i| u32::from_le_bytes(std::array::from_fn(|j| bytes[4 * i + j])))
}

/// Gives a file a second name, or copies it where that cannot be.
fn share(from: &Path, to: &Path) -> Result<(), OmnixError> {
    let write = |source| OmnixError::from(IoError::write(to, source));
    std::fs::create_dir_all(to.parent().unwrap_or(Path::new("."))).map_err(write)?;
    match std::fs::remove_file(to) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(write(error)),
        _ => {}
    }
    if std::fs::hard_link(from, to).is_ok() {
        return Ok(());
    }
    let read = |source| IoError::Read { path: from.to_owned(), source };
    let mut source = std::fs::File::open(from).map_err(read)?;
    let mut copy = AtomicFile::create(to).map_err(write)?;
    std::io::copy(&mut source, &mut copy).map_err(write)?;
    copy.commit().map_err(write)?;
    Ok(())
}

/// The saved field of a film: paths of any pixels through the windows, at any times.
#[derive(Debug)]
pub struct FilmField {
    engine: Engine,
    file: TensorReader,
    size: [usize; 2],
    images: Vec<FieldImage>,
    layout: Layout,
    chain: Chain,
    keys: Vec<u32>,
    about: About,
    /// The first window's field, which says how points move.
    first: Field,
}

impl FilmField {
    /// Whether a file joins the fields of a film's windows, rather than being a field itself.
    #[must_use]
    pub fn is_one(path: &Path) -> bool {
        TensorReader::open(path).is_ok_and(|file| file.metadata().get("format").is_some_and(|format| format == FORMAT))
    }

    /// Opens the file. Windows' fields are opened when they are asked for.
    ///
    /// # Errors
    /// A file that is absent, of another kind or version, cut short, or that contradicts itself; the first window's field is not there.
    pub fn open(engine: &Engine, path: &Path) -> Result<Self, OmnixError> {
        let file = TensorReader::open(path).map_err(OmnixError::Window)?;
        let said = |name: &str| file.metadata().get(name).cloned();
        if said("format").as_deref() != Some(FORMAT) {
            return Err(not(path, "its metadata does not name the format omnix-film-field"));
        }
        if let Some(found) = said("version").filter(|version| version != VERSION) {
            return Err(IoError::FieldVersion { found, known: VERSION, path: path.to_owned() }.into());
        }
        let dims = |name: &str| file.info(name).map_or(&[][..], |info| &info.shape);
        let (&[count, 4], &[images, height, width]) = (dims("windows"), dims("pictures")) else {
            return Err(not(path, "it has no windows or no pictures"));
        };
        let wanted: [(&str, &[usize]); 6] = [
            ("keys", &[count, 8]),
            ("to_part", &[count, 13]),
            ("extrinsics", &[images, 3, 4]),
            ("intrinsics", &[images, 3, 3]),
            ("times", &[images, 2]),
            ("seconds", &[images]),
        ];
        if let Some((name, _)) = wanted.iter().find(|(name, shape)| dims(name) != *shape) {
            return Err(not(path, &format!("its tensor `{name}` has another shape")));
        }
        let u32s = |name: &str, n: usize| file.read_u32(name, 0..n * count).map_err(OmnixError::Window);
        let (ranges, keys) = (u32s("windows", 4)?, u32s("keys", 8)?);
        let to_part = file.read_f64("to_part", 0..13 * count).map_err(OmnixError::Window)?;
        let places = placements(&ranges, &to_part).ok_or_else(|| not(path, "its windows are in no order"))?;
        let windows = ranges.as_chunks::<4>().0.iter();
        let windows = windows.map(|w| Window { images: w[0] as usize..w[1] as usize, shot: w[2] as usize }).collect();
        let layout = Layout::of(windows).filter(|layout| layout.images() == images);
        let layout = layout.ok_or_else(|| not(path, "its windows do not follow each other"))?;
        let chain = Chain::placed(&layout, places);
        let known = known(&file, images).map_err(OmnixError::Window)?;
        let about = About {
            network: said("network").unwrap_or_default(),
            weights: said("weights").unwrap_or_default(),
            unit: said("unit").unwrap_or_default(),
            note: said("note"),
            window: None,
        };
        let first = window(engine, path, 0, (&layout, &keys, [height, width]))?;
        let engine = engine.clone();
        Ok(Self { engine, file, size: [height, width], images: known, layout, chain, keys, about, first })
    }

    /// Height and width of an image.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// What is known of each image; cameras in the world of its part.
    #[must_use]
    pub fn images(&self) -> &[FieldImage] {
        &self.images
    }

    /// The images of each part of the film, which has a world of its own.
    #[must_use]
    pub fn parts(&self) -> &[std::ops::Range<usize>] {
        self.chain.parts()
    }

    /// Where it comes from.
    #[must_use]
    pub fn about(&self) -> &About {
        &self.about
    }

    /// Whether a pixel with this score moves.
    #[must_use]
    pub fn moves(&self, theta: f32) -> bool {
        self.first.moves(theta)
    }

    /// Flat indices (row · width + column) of pixels of an image, and where they are at `times`, `[times][pixels][3]`, in the world of the
    /// image's part: NaN from where a point is lost on, and in other parts. `each` is called before every step.
    ///
    /// # Errors
    /// [`OmnixError::Query`] for an image, pixel or time that is not there; failures of the device or of reading; of `each`.
    pub fn paths(
        &self,
        image: usize,
        pixels: &Pixels,
        times: &[usize],
        each: &mut dyn FnMut() -> Result<(), OmnixError>,
    ) -> Result<(Vec<u32>, Vec<f32>), OmnixError> {
        let follow = self.follow(image)?;
        let last = self.images.len() - 1;
        if let Some(time) = times.iter().find(|time| **time > last) {
            return Err(OmnixError::Query { reason: format!("there is no time {time}: times go from 0 to {last}") });
        }
        let all = || (0..(self.size[0] * self.size[1]) as u32).collect();
        let flat = pixels.resolve(self.first.shape())?.unwrap_or_else(all);
        let width = self.size[1] as u32;
        let list: Vec<[u32; 2]> = flat.iter().map(|pixel| [pixel % width, pixel / width]).collect();
        let mut open = |k: usize| {
            let field: Box<dyn super::WindowField> = Box::new(self.window(k)?);
            Ok(field)
        };
        let positions = follow.pixels((image, &list), times, &mut open, each)?;
        Ok((flat, positions))
    }

    /// Score, confidence and colour of some pixels of an image, as the window has them whose image it is.
    ///
    /// # Errors
    /// As [`FilmField::paths`].
    pub fn pixel_values(&self, image: usize, pixels: &Pixels) -> Result<PixelValues, OmnixError> {
        let k = self.own(image)?;
        let list = pixels.resolve(self.first.shape())?;
        let mut values = self.window(k)?.pixel_values(image - self.layout.windows()[k].images.start, pixels)?;
        let count = self.size[0] * self.size[1];
        let packed = match list {
            None => self.file.read_u32("pictures", image * count..(image + 1) * count),
            Some(list) => self.file.rows_u32("pictures", image * count, 1, &list),
        };
        let colour = |packed: u32| {
            let [r, g, b, _] = packed.to_le_bytes();
            [r, g, b]
        };
        values.colours = Some(packed.map_err(OmnixError::Window)?.into_iter().map(colour).collect());
        Ok(values)
    }

    /// World points of an image's pixels at its own time, in the world of its part.
    ///
    /// # Errors
    /// As [`FilmField::paths`].
    pub fn points(&self, image: usize) -> Result<Vec<[f32; 3]>, OmnixError> {
        let k = self.own(image)?;
        let points = self.window(k)?.points(image - self.layout.windows()[k].images.start)?;
        let to_part = self.chain.placements()[k].to_part;
        Ok(points.as_chunks().0.iter().map(|point| to_part.apply(*point)).collect())
    }

    /// The part that an image is in.
    fn follow(&self, image: usize) -> Result<Follow<'_>, OmnixError> {
        let part = self.chain.parts().iter().position(|part| part.contains(&image)).ok_or_else(|| {
            let last = self.images.len() - 1;
            OmnixError::Query { reason: format!("there is no image {image}: images go from 0 to {last}") }
        })?;
        Ok(Follow { layout: &self.layout, chain: &self.chain, size: self.size, part })
    }

    /// The window whose image it is.
    fn own(&self, image: usize) -> Result<usize, OmnixError> {
        let own = self.follow(image)?.window_of(image);
        own.ok_or_else(|| not(self.file.path(), "its windows and parts contradict each other"))
    }

    fn window(&self, k: usize) -> Result<Field, OmnixError> {
        window(&self.engine, self.file.path(), k, (&self.layout, &self.keys, self.size))
    }
}

fn not(path: &Path, reason: &str) -> OmnixError {
    IoError::NotAField { reason: reason.to_owned(), path: path.to_owned() }.into()
}

/// The field of window `k` beside the film's file.
fn window(
    engine: &Engine,
    film: &Path,
    k: usize,
    (layout, keys, size): (&Layout, &[u32], [usize; 2]),
) -> Result<Field, OmnixError> {
    let path = window_path(&film.parent().unwrap_or(Path::new("")).join(FOLDER), k);
    if !path.is_file() {
        let reason =
            format!("the field of its window {k} is not beside it, {FOLDER}/{k:06}.safetensors: keep both together");
        return Err(not(film, &reason));
    }
    let field = Field::open(engine, &path)?;
    let (shape, images) = (field.shape(), layout.windows()[k].images.len());
    let ours = field.about().window.as_deref().map(digest).is_some_and(|found| found == keys[8 * k..8 * k + 8]);
    if !ours || [shape.height, shape.width] != size || shape.images != images {
        let reason = format!("the field of its window {k}, {FOLDER}/{k:06}.safetensors, is that of another run");
        return Err(not(film, &reason));
    }
    Ok(field)
}

/// Where windows lie; `None` if the parts do not follow each other or a number does not fit.
fn placements(ranges: &[u32], to_part: &[f64]) -> Option<Vec<Placement>> {
    let place = |(range, numbers): (&[u32; 4], &[f64; 13])| {
        let sound = numbers.iter().all(|v| v.is_finite()) && numbers[0] > 0.0;
        sound.then(|| Placement {
            part: range[3] as usize,
            to_part: Similarity {
                scale: numbers[0],
                rotation: std::array::from_fn(|i| std::array::from_fn(|j| numbers[1 + 3 * i + j])),
                translation: std::array::from_fn(|i| numbers[10 + i]),
            },
        })
    };
    let places: Vec<Placement> =
        ranges.as_chunks().0.iter().zip(to_part.as_chunks().0).map(place).collect::<Option<_>>()?;
    let steps = places.windows(2).all(|pair| pair[1].part == pair[0].part || pair[1].part == pair[0].part + 1);
    (steps && places.first()?.part == 0).then_some(places)
}

/// What is known of each image.
fn known(file: &TensorReader, count: usize) -> Result<Vec<FieldImage>, omnix_tensors::TensorError> {
    let (extrinsics, intrinsics) =
        (file.read_f32("extrinsics", 0..12 * count)?, file.read_f32("intrinsics", 0..9 * count)?);
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
