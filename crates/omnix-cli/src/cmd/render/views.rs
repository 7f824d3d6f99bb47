//! Times and cameras of a film's pictures.

use omnix::geometry::{Camera, Curve, camera_on_curve, orbit_camera};
use omnix::render::{Shot, Stage};

use super::args::{RenderArgs, View};
use super::keys::{self, Key};
use super::output::Target;
use crate::cmd::query;
use crate::error::CliError;

/// Pictures of a camera that moves at one time.
const TURN: usize = 96;
/// Nothing is drawn nearer than this share of the distance of what is seen.
const NEAR: f32 = 0.02;
/// How far apart in depth discs of one surface may be: what the depths of several images differ by.
const LAYER: f32 = 0.015;
/// Distance of an orbit, in times that of its image's camera.
const AWAY: f64 = 1.35;

/// A picture of the film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    /// Time, from 0 for the first image.
    pub(super) time: f64,
    /// How much of the film is over: 0 to 1, or, of what goes round, to just below.
    along: f64,
}

/// The film's times and cameras.
pub(super) struct Views {
    times: Vec<usize>,
    image: usize,
    keys: Vec<Key>,
}

impl Views {
    /// Checks what was asked for of a source with this number of images.
    pub(super) fn new(args: &RenderArgs, images: usize) -> Result<Self, CliError> {
        let times = query::times(args.times.as_deref(), images)?;
        let image = args.image.unwrap_or((images - 1) / 2);
        if image >= images {
            return Err(CliError::Usage(format!("there is no image {image}: images go from 0 to {}", images - 1)));
        }
        let keys = if let View::Keys(path) = &args.view { keys::read(path)? } else { Vec::new() };
        Ok(Self { times, image, keys })
    }

    /// All pictures.
    pub(super) fn frames(&self, args: &RenderArgs, target: Target) -> Result<Vec<Frame>, CliError> {
        let last = self.times.len() - 1;
        if target == Target::Picture {
            if args.frames.is_some_and(|n| n > 1) || (args.times.is_some() && last > 0) {
                return Err(CliError::Usage(
                    "one .png holds one picture: name a folder or an .mp4, or one of the --times".to_owned(),
                ));
            }
            return Ok(vec![Frame { time: self.times[last] as f64, along: 0.0 }]);
        }
        let moves = !matches!(args.view, View::Still);
        let timed = self.keys.iter().any(|key| key.time.is_some());
        let count = match args.frames {
            Some(count) => count as usize,
            None if (last == 0 && moves && !matches!(args.view, View::Input | View::Spline)) || timed => TURN,
            None => last.saturating_mul(args.between as usize + 1) + 1,
        };
        let round = args.view == View::Orbit;
        let frame = |k: usize| {
            let steps = if round { count } else { count - 1 };
            let along = k as f64 / steps.max(1) as f64;
            // The last time is the last picture, whether the camera goes round or not.
            let at = k as f64 / (count - 1).max(1) as f64 * last as f64;
            let (low, part) = ((at.floor() as usize).min(last), at.fract());
            let [a, b] = [low, (low + 1).min(last)].map(|i| self.times[i] as f64);
            Frame { time: self.key_time(along).unwrap_or(a + (b - a) * part), along }
        };
        Ok((0..count).map(frame).collect())
    }

    /// The time that keys say.
    fn key_time(&self, along: f64) -> Option<f64> {
        let at = along * (self.keys.len().checked_sub(1)?) as f64;
        let (low, part) = (at.floor() as usize, at.fract());
        let [a, b] = [low, (low + 1).min(self.keys.len() - 1)].map(|i| self.keys[i].time);
        let (a, b) = (a?, b?);
        Some((a + (b - a) * part).max(0.0))
    }

    /// The camera of a picture, and what is behind the points.
    pub(super) fn shot(
        &self,
        args: &RenderArgs,
        stage: &Stage,
        frame: &Frame,
        [r, g, b]: [f32; 3],
        cover: f32,
    ) -> Shot {
        let cameras = stage.cameras();
        let around = |yaw: f64, pitch: f64, away: f64| {
            let camera = cameras[self.image];
            let turn = [args.yaw + yaw, args.pitch + pitch].map(f64::to_radians);
            orbit_camera(&camera, ahead(&camera, stage.distance()), turn, args.away.unwrap_or(away))
        };
        let on = |curve| camera_on_curve(cameras, frame.time, curve).unwrap_or(cameras[0]);
        let size = stage.size().map(|side| side as f32);
        let camera = match &args.view {
            View::Input => fitted(on(Curve::Through), size, args),
            View::Spline => fitted(on(Curve::Near), size, args),
            View::Still => fitted(around(0.0, 0.0, 1.0), size, args),
            View::Orbit => {
                let turn = std::f64::consts::TAU * frame.along;
                let yaw = if args.swing.abs() >= 180.0 {
                    360.0 * frame.along * args.swing.signum()
                } else {
                    args.swing * turn.sin()
                };
                // A third as far up as to the sides, and never down: there are floors.
                let pitch =
                    if args.swing.abs() >= 180.0 { 0.0 } else { args.swing.abs() / 3.0 * (1.0 - turn.cos()) / 2.0 };
                fitted(around(yaw, pitch, AWAY), size, args)
            }
            View::Keys(_) => {
                let cameras: Vec<Camera> = self.keys.iter().map(|key| key.camera).collect();
                let at = frame.along * (cameras.len() - 1) as f64;
                let camera = camera_on_curve(&cameras, at, Curve::Through).unwrap_or(cameras[0]);
                let [width, height] = args.size.map(|side| side as f32);
                let focal = camera.intrinsics[1][1] * height * args.zoom as f32;
                let intrinsics = [[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]];
                Camera { intrinsics, ..camera }
            }
        };
        Shot { camera, near: NEAR * stage.distance(), layer: LAYER, background: [r, g, b, cover] }
    }
}

/// The camera for pictures of the size asked for: all of its image is in them, and its middle in the middle.
fn fitted(camera: Camera, [width, height]: [f32; 2], args: &RenderArgs) -> Camera {
    let [across, down] = args.size.map(|side| side as f32);
    let scale = (across / width).min(down / height) * args.zoom as f32;
    let [[fx, skew, cx], [_, fy, cy], _] = camera.intrinsics;
    let (cx, cy) = ((cx - width / 2.0) * scale + across / 2.0, (cy - height / 2.0) * scale + down / 2.0);
    Camera { intrinsics: [[fx * scale, skew * scale, cx], [0.0, fy * scale, cy], [0.0, 0.0, 1.0]], ..camera }
}

/// The point that a camera looks at.
fn ahead(camera: &Camera, distance: f32) -> [f32; 3] {
    omnix::geometry::invert_pose(&camera.extrinsics).map(|row| row[2] * distance + row[3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        args: RenderArgs,
    }

    fn frames(images: usize, more: &[&str]) -> Result<Vec<Frame>, CliError> {
        let args = Line::try_parse_from([&["render", "run"], more].concat()).unwrap_or_else(|e| panic!("{e}")).args;
        Views::new(&args, images)?.frames(&args, Target::of(&args.out))
    }

    fn times(images: usize, more: &[&str]) -> Vec<f64> {
        frames(images, more).unwrap().iter().map(|frame| frame.time).collect()
    }

    #[test]
    fn pictures_lie_on_and_between_the_times() {
        assert_eq!(times(3, &["--out", "x", "--between", "1"]), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(times(9, &["--out", "x", "--times", "2,6", "--between", "1", "--view", "still"]), [2.0, 4.0, 6.0]);
        assert_eq!(times(3, &["--out", "x.mp4", "--frames", "2", "--view", "input"]), [0.0, 2.0]);
        assert_eq!(times(5, &["--out", "x.PNG"]), [4.0]);
        assert_eq!(times(5, &["--out", "x.png", "--times", "1"]), [1.0]);
        assert_eq!(times(1, &["--out", "x"]).len(), TURN);
        assert_eq!(times(1, &["--out", "x", "--view", "input"]), [0.0]);
        assert_eq!(times(4, &["--out", "x", "--frames", "1"]), [0.0]);
        for bad in [
            &["--out", "x.png", "--times", "0..3"][..],
            &["--out", "x", "--times", "7"],
            &["--out", "x", "--image", "4"],
        ] {
            assert!(frames(4, bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn an_orbit_ends_before_it_begins_again() {
        let along: Vec<f64> = frames(2, &["--out", "x", "--frames", "4"]).unwrap().iter().map(|f| f.along).collect();
        assert_eq!(along, [0.0, 0.25, 0.5, 0.75]);
    }
}
