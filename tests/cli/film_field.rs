//! The field of a film in windows: asked for any pixels and times of the whole film, drawn, and apart from what belongs to it.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Ran, array, folder, json, many, of_kind, omnix, reconstruct};

const SMALL: [&str; 4] = ["--size", "84x56", "--window", "8"];

fn query(field: &Path, more: &[&str]) -> Ran {
    omnix(&[&["query", field.to_str().unwrap()], more].concat())
}

/// A windowed run of 20 images of one scene; its folder.
fn film(dir: &Path, more: &[&str]) -> PathBuf {
    let out = dir.join("out");
    reconstruct(&many(dir, 20), &out, &[&SMALL[..], more].concat()).ok();
    out
}

/// An array of whole numbers.
fn whole<T: npyz::Deserialize>(npz: &Path, name: &str) -> Vec<T> {
    let mut file = npyz::npz::NpzArchive::open(npz).unwrap();
    file.by_name(name).unwrap().unwrap().into_vec().unwrap()
}

/// First and last image of each part.
fn parts(out: &Path) -> Vec<[usize; 2]> {
    let manifest = json(&out.join("manifest.json"));
    let parts = manifest["windows"]["parts"].as_array().unwrap();
    parts.iter().map(|part| [0, 1].map(|i| part["images"][i].as_u64().unwrap() as usize)).collect()
}

#[test]
fn a_point_is_followed_through_the_film() {
    let dir = tempfile::tempdir().unwrap();
    let out = film(dir.path(), &["--export", "field,tracks", "--points", "300"]);
    let field = out.join("field.safetensors");
    assert!(!out.join("windows").exists() && out.join("field/000002.safetensors").is_file());
    let manifest = json(&out.join("manifest.json"));
    let listed = manifest["files"].as_array().unwrap();
    assert!(listed.iter().any(|file| file["path"] == "field/000001.safetensors"), "{listed:?}");
    // The pictures are all the same, so that everything is joined: what was exported in the run is what is asked for now.
    let [first, last] = parts(&out)[0];
    let exported = if parts(&out).len() == 1 { out.clone() } else { out.join("part_000") };
    let image = first + 3;
    let npz = exported.join("exports/tracks/000003.npz");
    let (shape, tracks) = array(&npz, "trajectory");
    let pixels: Vec<i32> = whole(&npz, "pixel");
    let count = shape[1] as usize;
    let list: Vec<String> = pixels.chunks(2).map(|p| format!("{},{}", p[0], p[1])).collect();
    let names = dir.path().join("pixels.txt");
    fs::write(&names, list.join("\n")).unwrap();
    let table = dir.path().join("all.npz");
    let number = image.to_string();
    let which = ["--image", number.as_str(), "--pixels", names.to_str().unwrap()];
    query(&field, &[&which[..], &["--out", table.to_str().unwrap()]].concat()).ok();
    let (shape, paths) = array(&table, "trajectory");
    assert_eq!(shape, [20, count as u64, 3]);
    let bits = |v: &[f32]| v.iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
    assert_eq!(bits(&paths[3 * first * count..3 * (last + 1) * count]), bits(&tracks));
    assert!(last > 8 && paths[3 * 9 * count..].iter().any(|v| v.is_finite()), "followed over a seam");
    // One time alone, at the other end of the part, and the same as text.
    let (table, time) = (dir.path().join("one.npz"), last.to_string());
    query(&field, &[&which[..], &["--times", &time, "--out", table.to_str().unwrap()]].concat()).ok();
    let (_, one) = array(&table, "trajectory");
    assert_eq!(bits(&one), bits(&paths[3 * last * count..3 * (last + 1) * count]));
    let colours: Vec<u8> = whole(&table, "rgb");
    assert!(colours.len() == 3 * count && colours.iter().any(|v| *v > 0));
    let text = query(&field, &[&which[..2], &["--pixel", &list[0]]].concat()).ok();
    let known = (0..20).filter(|t| paths[3 * t * count].is_finite()).count();
    assert_eq!(text.out.lines().count(), 1 + known, "{}", text.out);
    let events = query(&field, &[&which[..2], &["--stride", "28", "--json"]].concat()).ok().events();
    assert_eq!(of_kind(&events, "path").len(), 6);
    assert_eq!(of_kind(&events, "path")[0]["positions"].as_array().unwrap().len(), 20);
    // And seen.
    if parts(&out).len() == 1 {
        let picture = dir.path().join("seen.png");
        omnix(&[
            "render",
            out.to_str().unwrap(),
            "--out",
            picture.to_str().unwrap(),
            "--times",
            "12",
            "--size",
            "84x56",
        ])
        .ok();
        assert_eq!(image::image_dimensions(&picture).unwrap(), (84, 56));
    }
}

#[test]
fn a_point_is_lost_in_other_parts() {
    let dir = tempfile::tempdir().unwrap();
    let frames = dir.path().join("frames");
    fs::create_dir_all(&frames).unwrap();
    for k in 0..14 {
        let colour = if k < 6 { [230, 40, 20] } else { [20, 40, 230] };
        let data: Vec<u8> = (0..90 * 150).flat_map(|i| colour.map(|c: u8| c.wrapping_add((i % 17) as u8))).collect();
        image::save_buffer(frames.join(format!("{k:03}.png")), &data, 150, 90, image::ColorType::Rgb8).unwrap();
    }
    let out = dir.path().join("out");
    reconstruct(&frames, &out, &[&SMALL[..], &["--export", "field", "--field-type", "f16"]].concat()).ok();
    assert!(parts(&out).iter().any(|[first, _]| *first == 6), "{:?}", parts(&out));
    let field = out.join("field.safetensors");
    let text = query(&field, &["--image", "2", "--pixel", "9,9"]).ok();
    let times: Vec<&str> = text.out.lines().skip(1).map(|line| line.split(',').nth(3).unwrap()).collect();
    assert!(!times.is_empty() && times.iter().all(|time| time.parse::<u32>().unwrap() < 6), "{}", text.out);
    omnix(&["render", out.to_str().unwrap(), "--out", dir.path().join("a.png").to_str().unwrap(), "--times", "0"])
        .fails(2, &["parts", "part_000"]);
}

#[test]
fn what_does_not_belong_to_a_film_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    reconstruct(&folder(dir.path(), 12), &out, &[&SMALL[..], &["--export", "field"]].concat()).ok();
    let field = out.join("field.safetensors");
    query(&field, &["--image", "12", "--stride", "9"]).fails(2, &["images go from 0 to 11"]);
    query(&field, &["--image", "0", "--pixel", "84,0"]).fails(2, &["columns go from 0 to 83"]);
    query(&field, &["--image", "0", "--stride", "9", "--times", "12"]).fails(2, &["times go from 0 to 11"]);
    // A window of its own answers as any field does.
    query(&out.join("field/000001.safetensors"), &["--image", "0", "--pixel", "9,9"]).ok();
    let [first, second] = ["000000", "000001"].map(|name| out.join(format!("field/{name}.safetensors")));
    let kept = fs::read(&second).unwrap();
    fs::copy(&first, &second).unwrap();
    query(&field, &["--image", "11", "--pixel", "9,9"]).fails(3, &["window 1", "another run"]);
    fs::remove_file(&second).unwrap();
    query(&field, &["--image", "11", "--pixel", "9,9"]).fails(3, &["window 1", "not beside it"]);
    fs::write(&second, kept).unwrap();
    query(&field, &["--image", "11", "--pixel", "9,9"]).ok();
    // Cut, of another version, and with windows in another order.
    let bytes = fs::read(&field).unwrap();
    let broken = out.join("broken.safetensors");
    fs::write(&broken, &bytes[..bytes.len() - 100]).unwrap();
    query(&broken, &["--image", "0", "--stride", "9"]).fails(3, &["broken.safetensors"]);
    let at = bytes.windows(13).position(|w| w == b"\"version\":\"1\"").unwrap();
    let mut other = bytes.clone();
    other[at + 11] = b'9';
    fs::write(&broken, other).unwrap();
    query(&broken, &["--image", "0", "--stride", "9"]).fails(3, &["version", "9"]);
    let header = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let text = std::str::from_utf8(&bytes[8..8 + header]).unwrap();
    let header_json: serde_json::Value = serde_json::from_str(text).unwrap();
    let begin = 8 + header + header_json["windows"]["data_offsets"][0].as_u64().unwrap() as usize;
    for (number, value) in [(0, 1u32), (1, 99), (4, 0), (7, 5)] {
        let mut other = bytes.clone();
        other[begin + 4 * number..][..4].copy_from_slice(&value.to_le_bytes());
        fs::write(&broken, other).unwrap();
        query(&broken, &["--image", "0", "--stride", "9"]).fails(3, &["windows"]);
    }
}
