//! What is wrong with cameras that do not fit their depth or tracks.
//!
//! The cameras are changed in the ways in which data sets are known to be wrong: poses of the other direction, transposed rotations, other axes
//! of the camera (all 48 orders and signs), other axes of the world of the tracks, positions mirrored along an axis; focal lengths by a
//! factor and the principal point by an offset, which are searched for. A change is a fault found when it lowers the cost (the mean of
//! truncated errors over all points, beyond the share of points that are hidden or outside anyway) by more than a third. At most one change of each kind, poses and intrinsics, is looked for.

use std::fmt;

use glam::{DMat3, DVec3};

use super::tracks::{Place, places};
use super::warp;
use crate::Sample;
use crate::rigid::{Pinhole, Rigid};

/// Pairs of images that the search looks at.
const PAIRS: usize = 6;
/// Relative error of depth, and error of places as a share of the image's width, that count as wholly wrong.
const DEPTH: f64 = 0.1;
const PLACE: f64 = 0.05;
/// A change has to bring the cost, less what any cameras cost, below this share of what it was, and by this much.
const BETTER: f64 = 0.67;
const LEAST: f64 = 0.03;
/// Factors of the focal length with which the search starts.
const FACTORS: [f64; 5] = [1.0, 0.5, 2.0, 0.71, 1.41];
/// Halvings of the search's steps: the last is a thousandth of the image.
const HALVINGS: usize = 8;
/// Steps of one length.
const STEPS: usize = 8;
/// Bound of ln of the focal factor, and of the principal point's offset as a share of the image.
const FARTHEST: f64 = 1.2;

/// A change of the cameras that makes them fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fault {
    /// Camera to world where world to camera is expected, or the other way.
    Inverted,
    /// Rotations transposed, beside right positions of the cameras, or right translations.
    Transposed {
        /// Positions are right.
        positions: bool,
    },
    /// Other axes of the camera: the matrix from the file's axes to ours.
    CameraAxes(DMat3),
    /// Other axes of the world than those of the tracks.
    WorldAxes(DMat3),
    /// Positions of the cameras mirrored along an axis of the world.
    Mirrored(usize),
    /// Focal lengths that have to be multiplied by this.
    Focal(f64),
    /// A principal point that has to be moved by this number of pixels.
    Principal([f64; 2]),
}

impl Fault {
    /// A short name.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Inverted => "inverted_poses",
            Self::Transposed { .. } => "transposed_rotation",
            Self::CameraAxes(m) if *m == ned() => "ned_axes",
            Self::CameraAxes(m) if m.determinant() < 0.0 => "flipped_axis",
            Self::CameraAxes(_) => "camera_axes",
            Self::WorldAxes(_) => "world_axes",
            Self::Mirrored(_) => "flipped_axis",
            Self::Focal(_) => "focal_length",
            Self::Principal(_) => "principal_point",
        }
    }

    fn apply(&self, camera: &Pinhole) -> Pinhole {
        let mut out = *camera;
        let Rigid { rotation, translation } = camera.w2c;
        match *self {
            Self::Inverted => out.w2c = camera.w2c.inverse(),
            Self::Transposed { positions: false } => out.w2c.rotation = rotation.transpose(),
            Self::Transposed { positions: true } => {
                let centre = camera.w2c.inverse().translation;
                out.w2c = Rigid { rotation: rotation.transpose(), translation: -(rotation.transpose() * centre) };
            }
            Self::CameraAxes(m) => out.w2c = Rigid { rotation: m * rotation, translation: m * translation },
            Self::WorldAxes(m) => out.w2c.rotation = rotation * m,
            Self::Mirrored(axis) => {
                let mut centre = camera.w2c.inverse().translation;
                centre[axis] = -centre[axis];
                out.w2c.translation = -(rotation * centre);
            }
            Self::Focal(by) => out.focal = camera.focal.map(|f| f * by),
            Self::Principal(by) => out.principal = [camera.principal[0] + by[0], camera.principal[1] + by[1]],
        }
        out
    }
}

/// From north-east-down axes of a body (x forward, y right, z down) to ours.
fn ned() -> DMat3 {
    DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y)
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inverted => {
                write!(f, "the poses are of the other direction (camera to world for world to camera): invert them")
            }
            Self::Transposed { positions } => {
                let beside = if *positions { "positions of the cameras" } else { "translations" };
                write!(f, "the rotations are transposed, the {beside} beside them are right: transpose them")
            }
            Self::CameraAxes(m) => {
                let named =
                    [(DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)), " (OpenGL, Blender)"), (ned(), " (NED)")];
                let name = named.iter().find(|(known, _)| known == m).map_or("", |(_, name)| name);
                let mirrored = if m.determinant() < 0.0 { ", which mirrors" } else { "" };
                let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(direction);
                write!(
                    f,
                    "the cameras' axes are x {x}, y {y}, z {z}{name}{mirrored} where x right, y down, z forward is expected: turn them"
                )
            }
            Self::WorldAxes(m) => {
                let axis = |v: DVec3| {
                    let k = (0..3).find(|k| v[*k] != 0.0).unwrap_or(0);
                    format!("{}{}", if v[k] < 0.0 { "-" } else { "" }, ["x", "y", "z"][k])
                };
                let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(axis);
                write!(
                    f,
                    "the world of the paths is not that of the cameras: its x, y, z are the cameras' {x}, {y}, {z}"
                )
            }
            Self::Mirrored(axis) => {
                write!(f, "the positions of the cameras are mirrored along the world's {} axis", ["x", "y", "z"][*axis])
            }
            Self::Focal(by) => write!(f, "the focal lengths are {:.3} times as long as they should be", by.recip()),
            Self::Principal([x, y]) => {
                write!(
                    f,
                    "the principal point is off: it should lie {x:.1} pixels further right and {y:.1} further down"
                )
            }
        }
    }
}

/// Where an axis of the camera points.
fn direction(axis: DVec3) -> &'static str {
    let names = [["right", "left"], ["down", "up"], ["forward", "back"]];
    let k = (0..3).find(|k| axis[*k] != 0.0).unwrap_or(0);
    names[k][usize::from(axis[k] < 0.0)]
}

/// All orders and signs of the axes; the identity first.
fn axes() -> Vec<DMat3> {
    let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let mut all = Vec::with_capacity(48);
    for order in orders {
        for signs in 0..8u8 {
            let column = |k: usize| {
                let mut axis = DVec3::ZERO;
                axis[order[k]] = if signs >> k & 1 == 1 { -1.0 } else { 1.0 };
                axis
            };
            all.push(DMat3::from_cols(column(0), column(1), column(2)));
        }
    }
    all
}

/// What the changes are judged by.
struct Judge<'a> {
    sample: &'a Sample,
    pairs: &'a [[usize; 2]],
    places: Vec<Place>,
}

impl Judge<'_> {
    /// The mean of what depth between views and places in images cost.
    fn cost(&self, cameras: &[Pinhole]) -> f64 {
        self.cost_and_floor(cameras)[0]
    }

    /// The same, and the share of it that is of points which cost as much as can be.
    fn cost_and_floor(&self, cameras: &[Pinhole]) -> [f64; 2] {
        let warp = warp::cost(self.sample, cameras, self.pairs, DEPTH);
        let scale = PLACE * f64::from(self.sample.size()[0]);
        let place = |place: &Place| {
            let seen = cameras[place.image].w2c.apply(place.point);
            let [u, v] = cameras[place.image].project(seen);
            let off = (u - place.pixel[0]).hypot(v - place.pixel[1]);
            if seen.z > 0.0 { (off / scale).min(1.0) } else { 1.0 }
        };
        let count = self.places.len();
        let places = (count > 0).then(|| {
            let costs = self.places.iter().map(place);
            let sums = costs.fold([0.0, 0.0], |[sum, whole], c| [sum + c, whole + f64::from(u8::from(c == 1.0))]);
            sums.map(|v| v / count as f64)
        });
        match (warp, places) {
            (Some(a), Some(b)) => [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0],
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => [0.0, 0.0],
        }
    }

    /// The best change of the poses.
    fn poses(&self, cameras: &[Pinhole]) -> Vec<Fault> {
        let mut changes =
            vec![Fault::Inverted, Fault::Transposed { positions: true }, Fault::Transposed { positions: false }];
        changes.extend(axes().into_iter().skip(1).map(Fault::CameraAxes));
        changes.extend((0..3).map(Fault::Mirrored));
        if !self.places.is_empty() {
            changes.extend(axes().into_iter().skip(1).map(Fault::WorldAxes));
        }
        let costs = changes.into_iter().map(|change| (self.cost(&changed(cameras, &[change])), change));
        // The first of equal ones: those in front are more common.
        let best = costs.fold(None, |best: Option<(f64, Fault)>, next| match best {
            Some(best) if best.0 <= next.0 + 1e-9 => Some(best),
            _ => Some(next),
        });
        best.map(|(_, change)| vec![change]).unwrap_or_default()
    }

    /// The best change of the intrinsics.
    fn intrinsics(&self, cameras: &[Pinhole]) -> Vec<Fault> {
        let [width, height] = self.sample.size().map(f64::from);
        let first = cameras[0].principal;
        // ln of the focal factor, offset of the principal point as a share of the image.
        let changes = |at: [f64; 3]| vec![Fault::Focal(at[0].exp()), Fault::Principal([at[1] * width, at[2] * height])];
        let cost = |at: [f64; 3]| self.cost(&changed(cameras, &changes(at)));
        let centre = [0.5 - first[0] / width, 0.5 - first[1] / height];
        let starts = FACTORS.iter().flat_map(|f| [[f.ln(), 0.0, 0.0], [f.ln(), centre[0], centre[1]]]);
        let least = |a: (f64, [f64; 3]), b: (f64, [f64; 3])| if b.0 < a.0 { b } else { a };
        let Some(mut best) = starts.map(|at| (cost(at), at)).reduce(least) else {
            return Vec::new();
        };
        let mut steps = [0.2, 0.1, 0.1];
        for _ in 0..HALVINGS {
            // Down each axis while that helps: a few steps, and not to cameras that no picture has.
            for _ in 0..STEPS {
                let around = (0..3).flat_map(|axis| [1.0, -1.0].map(|sign| (axis, sign)));
                let next = around.filter_map(|(axis, sign)| {
                    let mut at = best.1;
                    at[axis] += sign * steps[axis];
                    at.iter().all(|v| v.abs() <= FARTHEST).then(|| (cost(at), at))
                });
                match next.reduce(least) {
                    Some(next) if next.0 < best.0 - 1e-6 => best = next,
                    _ => break,
                }
            }
            steps = steps.map(|step| step / 2.0);
        }
        let [focal, right, down] = best.1;
        let mut found = changes(best.1);
        found.retain(|change| match change {
            Fault::Focal(_) => focal.abs() > 0.02,
            _ => right.abs().max(down.abs()) > 0.005,
        });
        found
    }
}

fn changed(cameras: &[Pinhole], changes: &[Fault]) -> Vec<Pinhole> {
    cameras.iter().map(|camera| changes.iter().fold(*camera, |camera, change| change.apply(&camera))).collect()
}

/// The faults of cameras that do not fit: none where no change of them helps.
pub(super) fn find(sample: &Sample, cameras: &[Pinhole], pairs: &[[usize; 2]], paths_are_off: bool) -> Vec<Fault> {
    // Paths that fit these cameras may have been made with them, and would hold on to their faults.
    let places = if paths_are_off { places(sample) } else { Vec::new() };
    let judge = Judge { sample, pairs: &pairs[..pairs.len().min(PAIRS)], places };
    let (mut cameras, mut faults) = (cameras.to_vec(), Vec::new());
    let mut cost = judge.cost(&cameras);
    // One change of the poses and one of the intrinsics, the one that helps most first.
    for _ in 0..2 {
        let tried = [judge.poses(&cameras), judge.intrinsics(&cameras)];
        let costs = tried.map(|changes| (judge.cost(&changed(&cameras, &changes)), changes));
        let Some((best, changes)) = costs.into_iter().reduce(|a, b| if b.0 < a.0 { b } else { a }) else {
            break;
        };
        let next = changed(&cameras, &changes);
        let floor = judge.cost_and_floor(&next)[1];
        if changes.is_empty() || best - floor > BETTER * (cost - floor) || cost - best < LEAST {
            break;
        }
        cameras = next;
        cost = best;
        faults.extend(changes);
    }
    faults
}
