//! A room with two balls that move, seen by a camera that moves too: every pixel's path is known in closed form.
//!
//! OpenCV axes: x right, y down, z forward. Pictures come from intersecting each pixel's ray with the room and the balls.

use omnix_io::{
    Picture,
    output::motion::{ImageTime, MotionView, MovingPoints},
};

type V = [f64; 3];

const WIDTH: u32 = 252;
const HEIGHT: u32 = 168;
const FOCAL: f64 = 200.0;

fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
fn scale(a: V, s: f64) -> V {
    a.map(|v| v * s)
}
fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn unit(a: V) -> V {
    scale(a, 1.0 / dot(a, a).sqrt())
}

/// Centre and radius of ball `which` at `s` in 0..1: one bounces across the room, one circles.
fn ball(which: usize, s: f64) -> (V, f64) {
    if which == 0 {
        ([-1.9 + 3.8 * s, 0.55 - 1.3 * (s * 2.5 * std::f64::consts::PI).sin().abs(), 4.6], 0.45)
    } else {
        let turn = s * std::f64::consts::TAU * 0.8;
        ([1.2 * turn.cos(), -0.2 + 0.25 * turn.sin(), 5.2 + 1.1 * turn.sin()], 0.3)
    }
}

/// A camera on an arc that looks into the room: centre and axes (right, down, forward).
fn camera(s: f64) -> (V, [V; 3]) {
    let turn = (s - 0.5) * 0.7;
    let centre = [2.4 * turn.sin(), -0.5 - 0.2 * s, -0.4 + 0.5 * s];
    let forward = unit(sub([0.0, 0.1, 5.0], centre));
    let right = unit(cross([0.0, 1.0, 0.0], forward));
    (centre, [right, cross(forward, right), forward])
}

/// Where a ray first meets the scene at `s`: distance, colour, the ball it met.
fn hit(from: V, ray: V, s: f64) -> (f64, V, Option<usize>) {
    let tile = |u: f64, v: f64| if (u.floor() + v.floor()).rem_euclid(2.0) < 1.0 { 1.0 } else { 0.78 };
    let mut best = (f64::INFINITY, [0.0; 3], None);
    let mut offer = |distance: f64, colour: &dyn Fn(V) -> V, ball| {
        if distance > 1e-6 && distance < best.0 {
            best = (distance, colour(add(from, scale(ray, distance))), ball);
        }
    };
    offer((1.0 - from[1]) / ray[1], &|p| scale([184.0, 150.0, 116.0], tile(p[0] * 1.5, p[2] * 1.5)), None);
    offer(
        (8.0 - from[2]) / ray[2],
        &|p| scale([126.0, 148.0, 176.0], 0.82 + 0.1 * (1.0 - p[1]).min(2.0) * tile(p[0], p[1])),
        None,
    );
    offer((-3.6 - from[0]) / ray[0], &|p| scale([150.0, 170.0, 140.0], tile(p[1], p[2])), None);
    offer((3.6 - from[0]) / ray[0], &|p| scale([178.0, 140.0, 150.0], tile(p[1], p[2])), None);
    for which in 0..2 {
        let (centre, radius) = ball(which, s);
        let to = sub(from, centre);
        let (a, b, c) = (dot(ray, ray), dot(to, ray), dot(to, to) - radius * radius);
        let square = b * b - a * c;
        if square > 0.0 {
            let base = if which == 0 { [236.0, 92.0, 60.0] } else { [70.0, 190.0, 226.0] };
            let shade = move |p: V| {
                let normal = scale(sub(p, centre), 1.0 / radius);
                let stripe = if (normal[1] * 4.0).floor().rem_euclid(2.0) < 1.0 { 1.0 } else { 0.72 };
                scale(base, stripe * (0.55 + 0.45 * dot(normal, unit([-0.4, -0.8, -0.5])).max(0.0)))
            };
            offer((-b - square.sqrt()) / a, &shade, Some(which));
        }
    }
    best
}

/// About `count` points, the same number from each of `times` images, those on the balls followed exactly.
pub(crate) fn moving(count: usize, times: usize) -> MovingPoints {
    let part = |time: usize| time as f64 / (times.max(2) - 1) as f64;
    let mut out = MovingPoints {
        views: Vec::new(),
        source: vec![],
        pixel: vec![],
        positions: vec![],
        colours: vec![],
        motion: vec![],
        confidence: vec![],
        moving: vec![],
    };
    let mut found: Vec<(V, Option<usize>)> = Vec::new();
    // Multiples of the golden section spread evenly over 0..1, and so do the pixels chosen by them over the picture.
    let share = count as f64 / times as f64 / f64::from(WIDTH * HEIGHT);
    let chosen = |i: u32| (f64::from(i) * 0.618_033_988_75).fract() < share;
    for time in 0..times {
        let (centre, axes) = camera(part(time));
        let mut data = Vec::with_capacity((3 * WIDTH * HEIGHT) as usize);
        for i in 0..WIDTH * HEIGHT {
            let (u, v) = (i % WIDTH, i / WIDTH);
            let [x, y] = [(f64::from(u) - 125.5) / FOCAL, (f64::from(v) - 83.5) / FOCAL];
            let ray = add(add(scale(axes[0], x), scale(axes[1], y)), axes[2]);
            let (distance, colour, which) = hit(centre, ray, part(time));
            let rgb = colour.map(|c| c as u8);
            data.extend(rgb);
            if chosen(i) {
                found.push((add(centre, scale(ray, distance)), which));
                out.source.push(time as u32);
                out.pixel.push([u, v]);
                out.colours.push(rgb);
                out.motion.push(if which.is_some() {
                    0.9 - 0.2 * y.abs() as f32
                } else {
                    0.04 + 0.1 * (x * y).abs() as f32
                });
                out.confidence.push(1.0 + (14.0 / distance) as f32);
                out.moving.push(which.is_some());
            }
        }
        let back = axes.map(|axis| -dot(axis, centre));
        out.views.push(MotionView {
            extrinsics: std::array::from_fn(|r| {
                [axes[r][0] as f32, axes[r][1] as f32, axes[r][2] as f32, back[r] as f32]
            }),
            intrinsics: [[FOCAL as f32, 0.0, 125.5], [0.0, FOCAL as f32, 83.5], [0.0, 0.0, 1.0]],
            time: ImageTime { video: 0, frame: 3 * time as u32, time_s: Some(0.1 * time as f64) },
            picture: Picture::new(WIDTH, HEIGHT, data),
        });
    }
    for time in 0..times {
        for (point, &(place, which)) in found.iter().enumerate() {
            let own = part(out.source[point] as usize);
            let moved = which.map_or([0.0; 3], |which| sub(ball(which, part(time)).0, ball(which, own).0));
            out.positions.extend(add(place, moved).map(|v| v as f32));
        }
    }
    out
}
