//! `splat` against its oracle, a scene whose picture is known, and what its order and its windows must not change.

use omnix_kernels::splat::{Splat, Y, view};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::splat::{Look, Seen, cases};
use omnix_tests::cases::{Call as _, Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "splat",
        tiers: [matches_the_oracle, a_cube_is_where_projection_puts_it, neither_order_nor_windows_change_a_bit, points_closer_than_samples_are_thinned_evenly],
        once: [impossible_pictures_are_errors],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

/// The picture of these points, `[height][width][4]`.
fn picture(gpu: &Gpu, spec: Splat, points: &[[f32; 3]], size: f32, colours: &[u32], view: &[f32]) -> Vec<[f32; 4]> {
    let scratch = Values::Out(spec.scratch_words() as usize);
    let args = [
        Values::F32(points.concat()),
        Values::F32(vec![size; points.len()]),
        Values::U32(colours.to_vec()),
        Values::F32(view.to_vec()),
        Values::Out((spec.width * spec.height * 4) as usize),
        scratch.clone(),
        scratch,
    ];
    computed_from(gpu, &Seen { spec, look: Look::Any }, &args, Y).as_chunks().0.to_vec()
}

/// The six faces of a cube of side 2 about the origin, each of another colour, 41 x 41 points a face.
fn cube() -> (Vec<[f32; 3]>, Vec<u32>) {
    let (mut points, mut colours) = (Vec::new(), Vec::new());
    for (face, colour) in [0x00_00ff, 0x00_ff00, 0xff_0000, 0x00_ffff, 0xff_ff00, 0xff_00ff].into_iter().enumerate() {
        for i in 0..41 * 41 {
            let [a, b] = [i % 41, i / 41].map(|k| k as f32 / 20.0 - 1.0);
            let side = if face < 3 { -1.0 } else { 1.0 };
            points.push(match face % 3 {
                0 => [side, a, b],
                1 => [a, side, b],
                _ => [a, b, side],
            });
            colours.push(colour);
        }
    }
    (points, colours)
}

/// Equal but for the last bits of a division.
fn is(a: [f32; 4], b: [f32; 4]) -> bool {
    (0..4).all(|c| (a[c] - b[c]).abs() < 1e-5)
}

/// From (0, 0, -5) the face z = -1 is all there is to see, 4 units away: 2 · 100 / 4 = 50 pixels wide about the middle, without a hole.
/// From (-5, 0, -5), turned by 45 degrees, two faces meet in the middle column.
fn a_cube_is_where_projection_puts_it(gpu: &Gpu) {
    let (points, colours) = cube();
    let spec = Splat { n: points.len() as u32, width: 100, height: 80, largest: 16 };
    let lens = [100.0, 0.0, 50.0, 100.0, 40.0];
    let front = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 5.0]];
    let seen = picture(gpu, spec, &points, 0.04, &colours, &view(&front, lens, 0.1, 0.01, [0.0; 4]));
    let at = |x: usize, y: usize| seen[y * 100 + x];
    for y in 0..80 {
        for x in 0..100 {
            // Discs reach a pixel beyond the last points, and those of the sides, just behind the edge, belong to it.
            let reach = f64::max((x as f64 + 0.5 - 50.0).abs(), (y as f64 + 0.5 - 40.0).abs());
            if reach < 23.0 {
                assert!(is(at(x, y), [0.0, 0.0, 1.0, 1.0]), "{x}, {y}: {:?}", at(x, y));
            } else if reach > 26.5 {
                assert_eq!(at(x, y), [0.0; 4], "{x}, {y}");
            }
        }
    }
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let corner = [[half, 0.0, -half, 0.0], [0.0, 1.0, 0.0, 0.0], [half, 0.0, half, 50f32.sqrt()]];
    let seen = picture(gpu, spec, &points, 0.04, &colours, &view(&corner, lens, 0.1, 0.01, [0.0; 4]));
    // Red is x = -1, blue z = -1; at an eighth to each side of the edge both are full.
    for (x, colour) in [(45, [1.0, 0.0, 0.0, 1.0]), (55, [0.0, 0.0, 1.0, 1.0])] {
        assert!(is(seen[40 * 100 + x], colour), "column {x}: {:?}", seen[40 * 100 + x]);
    }
}

fn neither_order_nor_windows_change_a_bit(gpu: &Gpu) {
    let call = Seen { spec: Splat { n: 3000, width: 90, height: 70, largest: 8 }, look: Look::Any };
    let whole = computed(gpu, &call, Y);
    let small = with_max_binding(gpu, 16_384);
    assert!(call.record(&small.caps).expect("records").len() > 12);
    assert!(computed(&small, &call, Y) == whole, "windows");
    // Back to front.
    let mut args = call.args(&gpu.caps);
    if let [Values::F32(points), Values::F32(sizes), Values::U32(colours), ..] = &mut args[..] {
        let reversed: Vec<[f32; 3]> = points.as_chunks().0.iter().rev().copied().collect();
        *points = reversed.concat();
        sizes.reverse();
        colours.reverse();
    }
    assert!(computed_from(gpu, &call, &args, Y) == whole, "order");
    assert!(whole.iter().any(|v| *v > 0.5));
}

/// A wall seen from so far that 64 points fall on a pixel keeps its colour and has no hole.
fn points_closer_than_samples_are_thinned_evenly(gpu: &Gpu) {
    let points: Vec<[f32; 3]> =
        (0..160 * 160).map(|i| [(i % 160) as f32 - 80.0, (i / 160) as f32 - 80.0, 80.0]).collect();
    let colours: Vec<u32> = (0..points.len()).map(|i| if i % 2 == 0 { 0x00ff_ffff } else { 0 }).collect();
    let spec = Splat { n: points.len() as u32, width: 20, height: 20, largest: 8 };
    let straight = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let view = view(&straight, [10.0, 0.0, 10.0, 10.0, 10.0], 0.1, 0.01, [0.0; 4]);
    let seen = picture(gpu, spec, &points, 0.6, &colours, &view);
    let inside: Vec<[f32; 4]> =
        (0..400).filter(|i| (2..18).contains(&(i % 20)) && (2..18).contains(&(i / 20))).map(|i| seen[i]).collect();
    assert!(inside.iter().all(|p| p[3] == 1.0), "a hole");
    let mean = inside.iter().map(|p| p[0]).sum::<f32>() / inside.len() as f32;
    assert!((mean - 0.5).abs() < 0.1, "{mean}");
}

fn impossible_pictures_are_errors() {
    let good = Splat { n: 5, width: 64, height: 4, largest: 8 };
    let caps = Caps::baseline();
    assert!(good.record(&caps).is_ok());
    for bad in [
        Splat { width: 0, ..good },
        Splat { height: 0, ..good },
        Splat { width: Splat::LARGEST_SIDE + 1, ..good },
        Splat { largest: 0, ..good },
        Splat { largest: Splat::LARGEST + 1, ..good },
    ] {
        assert!(bad.record(&caps).is_err(), "{bad:?}");
    }
    let tiny = Caps { max_binding: 512, ..caps };
    assert!(good.record(&tiny).expect_err("a row").to_string().contains("512"));
}
