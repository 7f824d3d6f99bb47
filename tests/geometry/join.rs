//! Windows of a made film, with exact depth and cameras and with errors as networks have them, joined one after the other.

use std::f64::consts::TAU;

use omnix_data::{Flag, Sample};
use omnix_geometry::{Camera, Join, Seen, Shared, Similarity, camera_centre, compose_poses, invert_pose, umeyama};
use omnix_scenes::validation;

const SIZE: [usize; 2] = [42, 56];
/// Images of the scene; a film plays them forth and back.
const IMAGES: usize = 32;
const FILM: usize = 300;

/// The first sample of one camera that moves, and not along a line.
fn scene() -> Sample {
    let samples = validation([SIZE[1], SIZE[0]], IMAGES).unwrap();
    let moves = |sample: &Sample| {
        let centres: Vec<[f64; 3]> =
            sample.cameras().iter().map(|camera| camera_centre(&camera.extrinsics).map(f64::from)).collect();
        umeyama(&centres, &centres).is_ok()
    };
    (0..40).step_by(3).map(|index| samples.get(index).unwrap()).find(moves).unwrap()
}

/// The image of the scene that the film shows at this place.
fn shown(place: usize) -> usize {
    let at = place % (2 * IMAGES - 2);
    at.min(2 * IMAGES - 2 - at)
}

/// A number in -1..1 from a few whole ones.
fn noise(numbers: [usize; 3]) -> f64 {
    let mut z = 0x9e37_79b9_7f4a_7c15u64;
    for n in numbers {
        z = (z ^ (n as u64 + 1)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z ^= z >> 29;
    }
    (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// How wrong what a window says is.
#[derive(Clone, Copy)]
struct Errors {
    /// Of depth, smooth over the picture, in parts of it.
    depth: f64,
    /// Of a camera's rotation, in degrees.
    turn: f64,
    /// Of its centre, in parts of the median depth.
    shift: f64,
}

const NONE: Errors = Errors { depth: 0.0, turn: 0.0, shift: 0.0 };
const USUAL: Errors = Errors { depth: 0.03, turn: 0.3, shift: 0.01 };

struct Said {
    camera: Camera,
    depth: Vec<f32>,
    still: Vec<bool>,
}

/// A rotation by `angles` (radians) about x, y and z, as a pose.
fn turned(angles: [f64; 3], shift: [f64; 3]) -> [[f32; 4]; 3] {
    let axis = |axis: usize, angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let mut rows = [[0.0f32; 4]; 3];
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        rows[axis][axis] = 1.0;
        (rows[a][a], rows[a][b], rows[b][a], rows[b][b]) = (cos as f32, -sin as f32, sin as f32, cos as f32);
        rows
    };
    let mut pose = compose_poses(&axis(0, angles[0]), &compose_poses(&axis(1, angles[1]), &axis(2, angles[2])));
    (0..3).for_each(|i| pose[i][3] = shift[i] as f32);
    pose
}

/// Window `k`'s own world, from the scene's.
fn world(k: usize) -> Similarity {
    if k == 0 {
        return Similarity::IDENTITY;
    }
    let n = |i: usize| noise([k, 77, i]);
    let pose = turned([n(0), n(1), n(2)], [0.0; 3]);
    Similarity {
        scale: (1.2 * n(3)).exp(),
        rotation: pose.map(|row| [row[0], row[1], row[2]].map(f64::from)),
        translation: [3.0 * n(4), 3.0 * n(5), 3.0 * n(6)],
    }
}

/// What window `k` says of a place in the film.
fn say(scene: &Sample, k: usize, place: usize, errors: Errors, median: f64) -> Said {
    let image = shown(place);
    let n = |i: usize| noise([k, place, i]);
    let camera = scene.cameras()[image];
    let turn = errors.turn.to_radians();
    let shift = errors.shift * median;
    let jitter = turned([turn * n(0), turn * n(1), turn * n(2)], [shift * n(3), shift * n(4), shift * n(5)]);
    let own = world(k);
    let extrinsics = own.apply_to_w2c(&compose_poses(&jitter, &camera.extrinsics));
    let moving = scene.moving(image).unwrap();
    let depth = scene.depth(image).unwrap().iter().enumerate().map(|(p, z)| {
        let (x, y) = ((p % SIZE[1]) as f64 / SIZE[1] as f64, (p / SIZE[1]) as f64 / SIZE[0] as f64);
        // Of one window much the same from image to image, as that of a network is; of what moves far more.
        let smooth = (TAU * (x + noise([k, 5, 0]))).sin() * (TAU * (y + noise([k, 5, 1]))).cos() + 0.3 * n(6);
        let wild = if moving[p] == Flag::Yes { 10.0 } else { 1.0 };
        (f64::from(*z) * own.scale * (1.0 + wild * errors.depth * smooth)) as f32
    });
    Said {
        camera: Camera { extrinsics, ..camera },
        depth: depth.collect(),
        still: moving.iter().map(|flag| *flag == Flag::No).collect(),
    }
}

/// The camera centres of the film in its first window's world, and the joins, by windows of `size` that share `overlap`.
fn film(scene: &Sample, images: usize, size: usize, overlap: usize, errors: Errors) -> (Vec<[f32; 3]>, Vec<Join>) {
    let mut depths: Vec<f32> = scene.depth(0).unwrap().iter().copied().filter(|z| z.is_finite()).collect();
    depths.sort_unstable_by(f32::total_cmp);
    let median = f64::from(depths[depths.len() / 2]);
    let said = |k: usize, place: usize| say(scene, k, place, errors, median);
    let (mut centres, mut joins, mut at) = (Vec::new(), Vec::new(), Similarity::IDENTITY);
    let (mut k, mut first) = (0, 0);
    loop {
        let end = (first + size).min(images);
        for place in centres.len()..end {
            centres.push(at.apply(camera_centre(&said(k, place).camera.extrinsics)));
        }
        if end == images {
            return (centres, joins);
        }
        let next = end - overlap;
        let mut shared = Shared::default();
        for place in next..end {
            let sides = [said(k, place), said(k + 1, place)];
            let sure = vec![1.0; SIZE[0] * SIZE[1]];
            let [earlier, later] = sides.each_ref().map(|said| Seen {
                depth: &said.depth,
                confidence: &sure,
                still: Some(&said.still),
                camera: said.camera,
            });
            shared.add(SIZE, &earlier, &later).unwrap();
        }
        let join = shared.fit().unwrap();
        at = at.after(&join.similarity);
        joins.push(join);
        (k, first) = (k + 1, next);
    }
}

/// Root mean square of the distances to the true centres after the best similarity, in parts of the true path's extent.
fn error(scene: &Sample, centres: &[[f32; 3]]) -> f64 {
    let truth: Vec<[f64; 3]> = (0..centres.len())
        .map(|place| camera_centre(&scene.cameras()[shown(place)].extrinsics).map(f64::from))
        .collect();
    let found: Vec<[f64; 3]> = centres.iter().map(|c| c.map(f64::from)).collect();
    let best = umeyama(&found, &truth).unwrap();
    let square = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>();
    let n = truth.len() as f64;
    let mean: [f64; 3] = std::array::from_fn(|i| truth.iter().map(|t| t[i]).sum::<f64>() / n);
    let extent = (truth.iter().map(|t| square(*t, mean)).sum::<f64>() / n).sqrt();
    let off = centres.iter().zip(&truth).map(|(c, t)| square(best.apply(*c).map(f64::from), *t)).sum::<f64>() / n;
    off.sqrt() / extent
}

#[test]
fn exact_windows_give_the_film_back() {
    let scene = scene();
    let (centres, joins) = film(&scene, FILM, 24, 6, NONE);
    assert_eq!(joins.len(), 16);
    let truth: Vec<[f32; 3]> = (0..FILM).map(|p| camera_centre(&scene.cameras()[shown(p)].extrinsics)).collect();
    let off = error(&scene, &centres);
    assert!(off < 1e-3, "{off}");
    // And in the first window's own world, not only up to a similarity.
    let apart = centres.iter().zip(&truth).map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max));
    let apart = apart.fold(0.0, f32::max);
    assert!(apart < 1e-2, "{apart}");
    assert!(joins.iter().all(|join| join.residual[1] < 1e-4 && join.moved[1] < 1e-4), "{joins:?}");
}

#[test]
fn errors_of_windows_add_up_slowly() {
    let scene = scene();
    let (single, none) = film(&scene, FILM, FILM, 1, USUAL);
    assert!(none.is_empty());
    let (joined, joins) = film(&scene, FILM, 60, 15, USUAL);
    let (one, many) = (error(&scene, &single), error(&scene, &joined));
    eprintln!("camera error: one pass {one:.4}, {} windows {many:.4}, ratio {:.2}", joins.len() + 1, many / one);
    let worst = joins.iter().map(|join| join.residual[0]).fold(0.0, f64::max);
    assert!(worst < 0.1, "joins that would be refused: {worst}");
    assert!(many <= 1.5 * one, "one pass {one}, in windows {many}");
}

#[test]
fn a_join_undoes_what_lies_between_two_worlds() {
    let scene = scene();
    for k in 1..6 {
        let mut shared = Shared::default();
        for place in 0..6 {
            let sides = [say(&scene, 0, place, NONE, 1.0), say(&scene, k, place, NONE, 1.0)];
            let sure = vec![1.0; SIZE[0] * SIZE[1]];
            let [earlier, later] = sides.each_ref().map(|said| Seen {
                depth: &said.depth,
                confidence: &sure,
                still: None,
                camera: said.camera,
            });
            shared.add(SIZE, &earlier, &later).unwrap();
        }
        let round = shared.fit().unwrap().similarity.after(&world(k));
        let p = invert_pose(&scene.cameras()[3].extrinsics).map(|row| row[3]);
        let q = round.apply(p);
        assert!((0..3).all(|i| (p[i] - q[i]).abs() < 1e-3), "{k}: {p:?} {q:?}");
        assert!((round.scale - 1.0).abs() < 1e-4, "{k}: {}", round.scale);
    }
}
