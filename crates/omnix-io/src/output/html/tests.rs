//! The page's text and numbers; what a browser makes of it is tested in `tests/viewer`.

use std::fs;

use serde_json::Value;

use super::super::motion::{ImageTime, MotionView};
use super::*;

/// `views` views of 8 x 6 pixels; three points, of which the second moves along x and the third is not finite at one time.
fn scene(views: usize) -> MovingPoints {
    let picture = || Picture::new(8, 6, (0..8 * 6 * 3).map(|i| i as u8).collect());
    let view = |i: usize| MotionView {
        extrinsics: [[1.0, 0.0, 0.0, 0.1 * i as f32], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        intrinsics: [[10.0, 0.0, 3.5], [0.0, 10.0, 2.5], [0.0, 0.0, 1.0]],
        time: ImageTime { video: 0, frame: i as u32, time_s: Some(0.1 * i as f64) },
        picture: picture(),
    };
    let mut positions = Vec::new();
    for time in 0..views {
        positions.extend([-1.0, 0.0, 2.0]);
        positions.extend([time as f32, 1.0, 4.0]);
        positions.extend([if time == 0 { f32::NAN } else { 0.0 }, 0.0, 1e9]);
    }
    MovingPoints {
        views: (0..views).map(view).collect(),
        source: vec![0; 3],
        pixel: vec![[0, 0], [1, 0], [2, 0]],
        positions,
        colours: vec![[255, 0, 1], [2, 3, 4], [9, 9, 9]],
        motion: vec![0.0, 1.0, 0.5],
        confidence: vec![1.0, 4.0, 2.0],
        moving: vec![false, true, true],
    }
}

fn empty(views: usize) -> MovingPoints {
    MovingPoints {
        source: vec![],
        pixel: vec![],
        positions: vec![],
        colours: vec![],
        motion: vec![],
        confidence: vec![],
        moving: vec![],
        ..scene(views)
    }
}

fn page(points: &MovingPoints, options: &HtmlOptions) -> String {
    let dir = tempfile::tempdir().unwrap();
    let path = write_html(points, options, &dir.path().join("viewer.html")).unwrap();
    fs::read_to_string(path).unwrap()
}

/// Text of the data element `id`.
fn element<'a>(page: &'a str, id: &str) -> &'a str {
    let (_, after) = page.split_once(&format!(" id=\"{id}\">")).unwrap_or_else(|| panic!("no {id}"));
    after.split_once("</script>").unwrap().0
}

fn meta_of(page: &str) -> Value {
    serde_json::from_str(element(page, "omnix-meta")).unwrap()
}

/// A decoder of its own: table search, one character at a time.
fn decode(text: &str) -> Vec<u8> {
    let table = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    assert_eq!(text.len() % 4, 0);
    let bits: Vec<u32> = text.trim_end_matches('=').chars().map(|c| table.find(c).unwrap() as u32).collect();
    let mut out = Vec::new();
    for group in bits.chunks(4) {
        let value = group.iter().fold(0, |v, b| v << 6 | b) << (6 * (4 - group.len()));
        out.extend(&value.to_be_bytes()[1..group.len()]);
    }
    out
}

fn words(text: &str) -> Vec<u16> {
    decode(text).chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect()
}

#[test]
fn base64_of_every_length() {
    let dir = tempfile::tempdir().unwrap();
    let encode = |bytes: &[u8]| {
        let mut file = AtomicFile::create(dir.path().join("x")).unwrap();
        let mut out = Base64::new(&mut file);
        // In two pieces, which must not show.
        out.put(&bytes[..bytes.len() / 2]).unwrap();
        out.put(&bytes[bytes.len() / 2..]).unwrap();
        out.finish().unwrap();
        fs::read_to_string(file.commit().unwrap()).unwrap()
    };
    // RFC 4648, section 10.
    for (text, code) in
        [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")]
    {
        assert_eq!(encode(text.as_bytes()), code);
    }
    let long: Vec<u8> = (0..50_000u32).map(|i| ((i * i) >> 3) as u8).collect();
    assert_eq!(decode(&encode(&long)), long);
}

#[test]
fn positions_are_within_half_a_step() {
    let points = scene(4);
    let positions = PositionBox::of(&points, [0, 1].into_iter());
    assert_eq!((positions.low, positions.high), ([-1.0, 0.0, 2.0], [3.0, 1.0, 4.0]));
    for time in 0..4 {
        let at = points.position(time, 1);
        let codes = positions.codes(at);
        for axis in 0..3 {
            let extent = positions.high[axis] - positions.low[axis];
            let back = positions.low[axis] + f32::from(codes[axis]) / 65535.0 * extent;
            assert!((back - at[axis]).abs() <= extent / 131_070.0 * 1.001, "{time} {axis}");
        }
    }
    assert_eq!(positions.codes([-1.0, 0.0, 2.0]), [0; 3]);
    assert_eq!(positions.codes([3.0, 1.0, 4.0]), [65535; 3]);
    // A flat box, and a box wider than single precision.
    assert_eq!(PositionBox { low: [2.0; 3], high: [2.0; 3] }.codes([2.0; 3]), [0; 3]);
    let wide = PositionBox { low: [f32::MIN; 3], high: [f32::MAX; 3] };
    assert_eq!(wide.codes([f32::MIN, 0.0, f32::MAX]), [0, 32768, 65535]);
}

#[test]
fn scores_and_confidence() {
    assert_eq!([0.0, 0.5, 1.0, 7.0, -1.0, f32::NAN].map(unit_code), [0, 32768, 65535, 65535, 0, 0]);
    let range = [1.0, 4.0];
    assert_eq!([1.0, 2.0, 4.0, f32::NAN, 0.0].map(|c| confidence_code(c, range)), [0, 32768, 65535, 0, 0]);
    assert_eq!(confidence_code(2.0, [2.0, 2.0]), 0);
    assert_eq!(encode::confidence_range(&scene(1), [0, 1, 2].into_iter()), [1.0, 4.0]);
    assert_eq!(encode::confidence_range(&scene(1), std::iter::empty()), [1.0, 1.0]);
}

#[test]
fn the_page_holds_what_it_was_given() {
    let page = page(&scene(3), &HtmlOptions::default());
    let meta = meta_of(&page);
    assert_eq!(
        (&meta["points"], &meta["changing"], &meta["moving"], &meta["left_out"]),
        (&2.into(), &1.into(), &1.into(), &1.into())
    );
    assert_eq!(meta["views"].as_array().unwrap().len(), 3);
    assert_eq!(meta["views"][2]["seconds"], 0.2);
    assert_eq!(meta["views"][0]["camera"]["corners"][0], serde_json::json!([-0.4_f32, -0.3_f32, 1.0_f32]));
    // The point that moves comes first.
    assert_eq!(decode(element(&page, "omnix-look")), [2, 3, 4, 255, 255, 0, 1, 0]);
    assert_eq!(words(element(&page, "omnix-scalars")), [0, 65535, 65535, 0, 0, 0, 0, 0]);
    assert_eq!(words(element(&page, "omnix-pixels")), [1, 0, 0, 0]);
    assert_eq!(words(element(&page, "omnix-still")), [0, 0, 0]);
    let along: Vec<u16> = (0..3).map(|t| words(element(&page, &format!("omnix-path-{t}")))[0]).collect();
    assert_eq!(along, [21845, 43690, 65535]);
    let jpeg = decode(element(&page, "omnix-picture-2"));
    assert_eq!(image::load_from_memory(&jpeg).unwrap().width(), 8);
    assert!(page.contains("Permission is hereby granted"), "three.js' licence is kept");
    assert!(!page.contains("<!--omnix:"));
    // Nothing in the page names a file or an address to load.
    assert!(!page.contains("src=\"http") && !page.contains("import("));
}

#[test]
fn pictures_are_reduced() {
    let page = page(&scene(1), &HtmlOptions { thumbnail_width: 4, ..Default::default() });
    let small = image::load_from_memory(&decode(element(&page, "omnix-picture-0"))).unwrap();
    assert_eq!((small.width(), small.height()), (4, 3));
}

#[test]
fn names_cannot_leave_their_place() {
    let evil = "</script><script>alert(\"1\")</script><!--omnix:three--> & 'x'";
    let options = HtmlOptions { title: evil.into(), notes: vec![evil.into()], unit: evil.into(), ..Default::default() };
    let page = page(&scene(2), &options);
    assert!(!page.contains("<script>alert"));
    assert!(page.contains(
        "<title>&lt;/script&gt;&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt;&lt;!--omnix:three--&gt; &amp; &#39;x&#39;</title>"
    ));
    let meta = meta_of(&page);
    assert_eq!((meta["title"].as_str(), meta["notes"][0].as_str()), (Some(evil), Some(evil)));
    let scripts = page.matches("</script>").count();
    assert_eq!(
        scripts,
        1 + 3 + 2 + 1 + 2 + 2,
        "meta; look, scalars and pixels; paths, still, pictures, three and the viewer"
    );
}

#[test]
fn few_points_views_and_times() {
    for views in [1, 3] {
        let meta = meta_of(&page(&empty(views), &HtmlOptions::default()));
        assert_eq!((&meta["points"], &meta["box"]["high"]), (&0.into(), &serde_json::json!([0.0, 0.0, 0.0])));
    }
    let one = page(&scene(1), &HtmlOptions::default());
    // Nothing changes place in one time; the point that is not finite is left out.
    let meta = meta_of(&one);
    assert_eq!((&meta["points"], &meta["changing"]), (&2.into(), &0.into()));
    assert_eq!(element(&one, "omnix-path-0"), "");
    let mut flat = scene(1);
    flat.views[0].extrinsics = [[0.0; 4]; 3];
    flat.views[0].time.time_s = None;
    let meta = meta_of(&page(&flat, &HtmlOptions::default()));
    assert!(meta["views"][0]["camera"].is_null() && meta["views"][0]["seconds"].is_null());
}

#[test]
fn what_does_not_fit_together_is_refused_and_nothing_is_left() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("viewer.html");
    let refuse = |points: &MovingPoints| write_html(points, &HtmlOptions::default(), &path).unwrap_err();
    let mut short = scene(2);
    short.positions.pop();
    assert!(matches!(refuse(&short), IoError::WrongSize { what: "positions", expected: 18, found: 17, .. }));
    let mut elsewhere = scene(2);
    elsewhere.source[2] = 2;
    assert!(matches!(refuse(&elsewhere), IoError::MissingField { index: 2, .. }));
    assert!(matches!(refuse(&empty(0)), IoError::MissingField { .. }));
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}
