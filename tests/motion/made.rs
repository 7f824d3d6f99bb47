//! A made-up scene: a wall that stands and a block of pixels that slides along x, seen by a camera that moves.

use omnix_io::{
    Picture,
    output::motion::{ImageTime, MotionView, MovingPoints},
};

pub(crate) const WIDTH: u32 = 8;
pub(crate) const HEIGHT: u32 = 6;
pub(crate) const PIXELS: usize = 48;

/// `count` images; every third belongs to a second video.
pub(crate) fn views(count: usize) -> Vec<MotionView> {
    let rgb = (0..PIXELS).flat_map(|i| [(i * 5) as u8, (255 - i) as u8, 40]).collect();
    let picture = Picture::new(WIDTH, HEIGHT, rgb);
    (0..count)
        .map(|i| {
            let (s, c) = (0.1 * i as f32).sin_cos();
            MotionView {
                extrinsics: [[c, 0.0, s, -0.25 * i as f32], [0.0, 1.0, 0.0, 0.1], [-s, 0.0, c, 0.0]],
                intrinsics: [[8.0, 0.0, 4.0], [0.0, 8.0, 3.0], [0.0, 0.0, 1.0]],
                time: ImageTime {
                    video: u32::from(i % 3 == 2),
                    frame: i as u32,
                    time_s: (i != 1).then(|| i as f64 / 10.0),
                },
                picture: picture.clone(),
            }
        })
        .collect()
}

/// Whether the pixel belongs to the block.
pub(crate) fn moves(pixel: usize) -> bool {
    (2..5).contains(&(pixel % 8)) && pixel / 8 > 2
}

/// Position of a pixel of image `source` at a time.
pub(crate) fn position(source: usize, pixel: usize, time: usize) -> [f32; 3] {
    let (x, y) = ((pixel % 8) as f32 - 4.0, (pixel / 8) as f32 - 3.0);
    let depth = 4.0 + source as f32 * 0.01;
    let slide = if moves(pixel) { 0.5 * (time as f32 - source as f32) } else { 0.0 };
    [x / 8.0 * depth + slide, y / 8.0 * depth, depth]
}

/// Score θ of a pixel.
pub(crate) fn score(pixel: usize) -> f32 {
    if moves(pixel) { 0.9 + 0.001 * pixel as f32 } else { 0.001 * pixel as f32 }
}

/// Every `step`-th pixel of every image.
pub(crate) fn points(images: usize, step: usize) -> MovingPoints {
    let chosen: Vec<(usize, usize)> =
        (0..images).flat_map(|s| (0..PIXELS).step_by(step).map(move |p| (s, p))).collect();
    let views = views(images);
    MovingPoints {
        source: chosen.iter().map(|c| c.0 as u32).collect(),
        pixel: chosen.iter().map(|c| [(c.1 % 8) as u32, (c.1 / 8) as u32]).collect(),
        positions: (0..images).flat_map(|t| chosen.iter().flat_map(move |c| position(c.0, c.1, t))).collect(),
        colours: chosen.iter().map(|c| std::array::from_fn(|i| views[0].picture.data[3 * c.1 + i])).collect(),
        motion: chosen.iter().map(|c| score(c.1)).collect(),
        confidence: chosen.iter().map(|c| 1.0 + 0.01 * c.1 as f32).collect(),
        moving: chosen.iter().map(|c| moves(c.1)).collect(),
        views,
    }
}
