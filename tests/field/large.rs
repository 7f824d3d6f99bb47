//! A field of many images: a query of it reads what it needs, and gives the bits that a whole image gives.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use omnix::io::output::field::{Dtype, FieldReader, FieldWriter, TensorSpec};
use omnix::{Field, FieldPlace, FieldPrecision, Pixels, Query, Weights};
use omnix_tests::Rng;

use crate::made::{HEIGHT, WIDTH, bits, engine, field, request};

/// Sizes of a field.
#[derive(Clone, Copy)]
struct Size {
    images: usize,
    height: usize,
    width: usize,
    levels: usize,
    points: usize,
}

impl Size {
    fn cells(self) -> [usize; 2] {
        [self.height / 14, self.width / 14]
    }

    fn specs(self, seconds: Dtype) -> Vec<TensorSpec> {
        let Self { images: t, height: h, width: w, levels: m, points: q } = self;
        let cells = self.cells()[0] * self.cells()[1];
        let f32s = |name: &str, shape: &[usize]| TensorSpec::new(name, Dtype::F32, shape);
        vec![
            f32s("field", &[t, m, t, cells, 9]),
            f32s("mask", &[t, cells]),
            f32s("offsets", &[t, h, w, m, q, 2]),
            f32s("weights", &[t, h, w, m, q]),
            f32s("points", &[t, h, w, 3]),
            f32s("theta", &[t, h, w]),
            f32s("confidence", &[t, h, w]),
            f32s("extrinsics", &[t, 3, 4]),
            f32s("intrinsics", &[t, 3, 3]),
            TensorSpec::new("times", Dtype::U32, [t, 2]),
            TensorSpec::new("seconds", seconds, [t]),
            TensorSpec::new("pictures", Dtype::U32, [t, h, w]),
        ]
    }

    fn metadata(self) -> BTreeMap<String, String> {
        let Self { images, height, width, levels, points } = self;
        let shape = serde_json::json!({
            "images": images, "height": height, "width": width, "grid": self.cells(), "levels": levels, "points": points,
        });
        let motion = serde_json::json!({ "relative_to_own_time": true, "rotation_min_norm": 1e-6, "gate": "blend", "threshold": null });
        BTreeMap::from([("shape".to_owned(), shape.to_string()), ("motion".to_owned(), motion.to_string())])
    }
}

/// A file with numbers of no meaning in every tensor.
fn made(path: &Path, size: Size) {
    let specs = size.specs(Dtype::F64);
    let mut file = FieldWriter::create(path, &specs, &size.metadata()).unwrap();
    for (seed, spec) in (1..).zip(&specs) {
        let n: usize = spec.shape.iter().product();
        match spec.dtype {
            Dtype::U32 => file.write_u32(&spec.name, &(0..n as u32).collect::<Vec<_>>()).unwrap(),
            Dtype::F64 => file.write_f64(&spec.name, &(0..n).map(|i| i as f64 / 25.0).collect::<Vec<_>>()).unwrap(),
            _ => file.write(&spec.name, &Rng::new(seed).normal(n)).unwrap(),
        }
    }
    file.finish().unwrap();
}

/// A file of this size in which all numbers are 0: no disk is needed for them.
fn hollow(path: &Path, size: Size) -> PathBuf {
    // A writer would write them; the header is that of a small file, with its own sizes.
    let mut header = serde_json::Map::new();
    let mut metadata = size.metadata();
    metadata.extend([("format".to_owned(), "omnix-field".to_owned()), ("version".to_owned(), "2".to_owned())]);
    header.insert("__metadata__".to_owned(), serde_json::json!(metadata));
    let mut at = 0;
    for spec in size.specs(Dtype::F64) {
        let end = at + spec.shape.iter().product::<usize>() * spec.dtype.size();
        let entry = serde_json::json!({ "dtype": spec.dtype.name(), "shape": spec.shape, "data_offsets": [at, end] });
        header.insert(spec.name, entry);
        at = end;
    }
    let text = serde_json::Value::Object(header).to_string();
    std::fs::write(path, [&(text.len() as u64).to_le_bytes(), text.as_bytes()].concat()).unwrap();
    let file = std::fs::OpenOptions::new().write(true).open(path).unwrap();
    file.set_len((8 + text.len() + at) as u64).unwrap();
    path.to_owned()
}

#[test]
fn one_pixel_of_many_images_reads_little() {
    let dir = tempfile::tempdir().unwrap();
    // As the release makes them of 200 frames: 16 GB, all of them holes.
    let size = Size { images: 200, height: 280, width: 504, levels: 4, points: 9 };
    let path = hollow(&dir.path().join("hollow.safetensors"), size);
    let total = std::fs::metadata(&path).unwrap().len();
    assert!(total > 15 << 30, "{total}");
    let field = Field::open(&engine(), &path).unwrap();
    let opened = field.bytes_read();
    assert!(opened < 100 << 10, "opening reads {opened} bytes");
    let one = Pixels::List(vec![[70, 42]]);
    let known = field.pixel_values(150, &one).unwrap();
    assert_eq!((known.theta.len(), known.colours.unwrap().len()), (1, 1));
    let read = field.bytes_read();
    assert!(read - opened <= 12, "theta, confidence and colour of a pixel are {} bytes", read - opened);
    // A pixel at one time: the field of two times, the mask, and a row of offsets, weights and points.
    let cells = 20 * 36;
    let needed = |times: u64| (size.levels as u64 * times * 9 + 1) * cells * 4 + (36 * 3 + 3) * 4;
    field.paths(&Query::new(150, one.clone(), 3..4)).unwrap();
    assert_eq!(field.bytes_read() - read, needed(2));
    // At all times: as much of the field as the image has, and no other image's.
    let read = field.bytes_read();
    field.paths(&Query::new(150, one, 0..size.images)).unwrap();
    assert_eq!(field.bytes_read() - read, needed(201));
    assert!(needed(201) < 25 << 20);
}

#[test]
fn few_pixels_give_the_bits_that_all_give() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("field.safetensors");
    for (size, rooms) in [
        (Size { images: 5, height: 42, width: 56, levels: 2, points: 4 }, &[None, Some(1 << 16)][..]),
        (Size { images: 1, height: 28, width: 14, levels: 1, points: 1 }, &[None]),
        (Size { images: 9, height: 28, width: 42, levels: 3, points: 2 }, &[None]),
    ] {
        made(&path, size);
        let mut opened = Field::open(&engine(), &path).unwrap();
        let pixels = size.height * size.width;
        // Fewer than an eighth, an eighth and more, in any order and again.
        let list = |n: usize| -> Vec<[u32; 2]> {
            let place = |i: usize| (i * 31 + 5) % pixels;
            (0..n)
                .map(|i| [(place(i) % size.width) as u32, (place(i) / size.width) as u32])
                .chain([[0, 0], [0, 0]])
                .collect()
        };
        for image in [0, size.images - 1] {
            let whole = opened.paths(&Query::new(image, Pixels::All, 0..size.images)).unwrap();
            let maps = opened.pixel_values(image, &Pixels::All).unwrap();
            for n in [1, 3, pixels / 8 - 3, pixels / 8 + 3] {
                for times in [0..size.images, 0..1, size.images / 2..size.images, size.images - 1..size.images] {
                    for room in rooms {
                        opened.set_room(*room);
                        let query = Query::new(image, Pixels::List(list(n)), times.clone());
                        let some = opened.paths(&query).unwrap();
                        let flat = some.pixels.clone().unwrap();
                        let at = |t: usize| flat.iter().flat_map(move |p| whole_at(t * pixels + *p as usize));
                        let expected: Vec<f32> = times.clone().flat_map(at).map(|i| whole.positions[i]).collect();
                        assert!(
                            bits(&some.positions) == bits(&expected),
                            "image {image}, {n} pixels, {times:?}, {room:?}"
                        );
                        let theta: Vec<f32> = flat.iter().map(|p| whole.theta[*p as usize]).collect();
                        assert_eq!(bits(&some.theta), bits(&theta));
                        opened.set_room(None);
                    }
                }
                let some = opened.pixel_values(image, &Pixels::List(list(n))).unwrap();
                let flat: Vec<usize> = list(n).iter().map(|[x, y]| *y as usize * size.width + *x as usize).collect();
                assert_eq!(some.theta, flat.iter().map(|p| maps.theta[*p]).collect::<Vec<_>>());
                assert_eq!(some.confidence, flat.iter().map(|p| maps.confidence[*p]).collect::<Vec<_>>());
                let colours = maps.colours.as_ref().unwrap();
                assert_eq!(some.colours.unwrap(), flat.iter().map(|p| colours[*p]).collect::<Vec<_>>());
            }
        }
    }
}

fn whole_at(point: usize) -> std::ops::Range<usize> {
    3 * point..3 * point + 3
}

#[test]
fn a_spool_gives_few_pixels_as_the_device_does() {
    let (weights, dir) = (Weights::builtin().unwrap(), tempfile::tempdir().unwrap());
    let resident = field(&weights, &request(3));
    let spooled = field(&weights, &request(3).field(FieldPlace::Spool(dir.path().to_owned())));
    let few = Pixels::List(vec![[WIDTH as u32 - 1, HEIGHT as u32 - 1], [3, 4], [3, 5], [3, 4]]);
    for times in [0..3, 1..2] {
        let query = Query::new(1, few.clone(), times);
        let (a, b) = (resident.paths(&query).unwrap(), spooled.paths(&query).unwrap());
        assert_eq!((bits(&a.positions), bits(&a.theta)), (bits(&b.positions), bits(&b.theta)));
        assert_eq!(resident.pixel_values(1, &few).unwrap(), spooled.pixel_values(1, &few).unwrap());
    }
    assert_eq!((resident.bytes_read(), spooled.bytes_read()), (0, 0));
}

#[test]
fn seconds_keep_what_a_clock_says() {
    let (weights, dir) = (Weights::builtin().unwrap(), tempfile::tempdir().unwrap());
    let mut made = field(&weights, &request(2));
    // The time of day in seconds since 1970, two frames of a video at 25 a second.
    let seconds = [Some(1_700_000_000.6), Some(1_700_000_000.64)];
    made.images_mut().iter_mut().zip(seconds).for_each(|(image, time)| image.time_s = time);
    let path = dir.path().join("field.safetensors");
    made.save(&path, FieldPrecision::F16).unwrap();
    let opened = Field::open(&engine(), &path).unwrap();
    assert_eq!(opened.images().iter().map(|i| i.time_s).collect::<Vec<_>>(), seconds);
    assert_eq!(opened.images(), made.images());
}

#[test]
fn a_field_of_version_1_opens() {
    let dir = tempfile::tempdir().unwrap();
    let size = Size { images: 2, height: 14, width: 14, levels: 1, points: 1 };
    let (path, old) = (dir.path().join("new.safetensors"), dir.path().join("old.safetensors"));
    let mut file = FieldWriter::create(&path, &size.specs(Dtype::F32), &size.metadata()).unwrap();
    for spec in size.specs(Dtype::F32) {
        let n: usize = spec.shape.iter().product();
        match spec.dtype {
            Dtype::U32 => file.write_u32(&spec.name, &vec![7; n]).unwrap(),
            _ if spec.name == "seconds" => file.write(&spec.name, &[0.6, f32::NAN]).unwrap(),
            _ => file.write(&spec.name, &vec![0.5; n]).unwrap(),
        }
    }
    file.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let at = bytes.windows(13).position(|w| w == b"\"version\":\"2\"").unwrap();
    std::fs::write(&old, [&bytes[..at], b"\"version\":\"1\"", &bytes[at + 13..]].concat()).unwrap();
    assert_eq!(FieldReader::open(&old).unwrap().metadata("version"), Some("1"));
    let field = Field::open(&engine(), &old).unwrap();
    assert_eq!(field.images().iter().map(|i| i.time_s).collect::<Vec<_>>(), [Some(f64::from(0.6f32)), None]);
    assert_eq!(field.picture(1).unwrap().unwrap().data[..3], [7, 0, 0]);
}

#[test]
fn what_f16_cannot_hold_is_saved_as_f32() {
    let dir = tempfile::tempdir().unwrap();
    let size = Size { images: 2, height: 14, width: 28, levels: 1, points: 2 };
    let path = dir.path().join("field.safetensors");
    made(&path, size);
    // One point far away, in the last image.
    let reader = FieldReader::open(&path).unwrap();
    let far = dir.path().join("far.safetensors");
    let mut file = FieldWriter::create(&far, &size.specs(Dtype::F64), &size.metadata()).unwrap();
    for spec in size.specs(Dtype::F64) {
        let n: usize = spec.shape.iter().product();
        match spec.dtype {
            Dtype::U32 => file.write_u32(&spec.name, &reader.read_u32(&spec.name, 0..n).unwrap()).unwrap(),
            Dtype::F64 => file.write_f64(&spec.name, &reader.read_f64(&spec.name, 0..n).unwrap()).unwrap(),
            _ => {
                let mut numbers = reader.read(&spec.name, 0..n).unwrap();
                if spec.name == "points" {
                    numbers[n - 1] = 70000.0;
                }
                file.write(&spec.name, &numbers).unwrap();
            }
        }
    }
    file.finish().unwrap();
    let saved = dir.path().join("half.safetensors");
    Field::open(&engine(), &far).unwrap().save(&saved, FieldPrecision::F16).unwrap();
    let types: BTreeMap<String, Dtype> =
        FieldReader::open(&saved).unwrap().specs().into_iter().map(|s| (s.name, s.dtype)).collect();
    assert_eq!((types["points"], types["offsets"], types["weights"]), (Dtype::F32, Dtype::F16, Dtype::F16));
    let again = Field::open(&engine(), &saved).unwrap();
    assert_eq!(again.points(1).unwrap().last(), Some(&70000.0));
}
