//! Where things are at a time: tracks, turns, joints. All exact functions of time in seconds, f64.
//!
//! A thing that moves has a root pose (a [`Track`] and a [`Turn`], on a [`Clock`] that may start late or stop early) and joints
//! in a tree, each with one degree of freedom; its rigid parts hang on joints. Angles are radians, rates radians a second.

use glam::{DAffine3, DQuat, DVec3};

/// Downward acceleration in metres a second squared.
const GRAVITY: f64 = 9.81;

/// Position over time.
#[derive(Debug, Clone)]
pub(crate) enum Track {
    Fixed(DVec3),
    /// A Catmull-Rom spline through points, at a steady parameter from second 0 to `seconds`; stands still outside.
    Spline {
        points: Vec<DVec3>,
        seconds: f64,
    },
    /// Thrown from a point; bounces off z = `floor` with a part of its speed, and comes to rest.
    Thrown {
        from: DVec3,
        velocity: DVec3,
        floor: f64,
        bounce: f64,
    },
    /// Hangs `arm` below a pivot and swings about a horizontal axis through it.
    Swing {
        pivot: DVec3,
        arm: f64,
        axis: DVec3,
        angle: Angle,
    },
    /// Up and down, and a little to the sides, about a point.
    Hover {
        centre: DVec3,
        by: DVec3,
        rate: f64,
        phase: f64,
    },
}

/// Orientation over time.
#[derive(Debug, Clone)]
pub(crate) enum Turn {
    Fixed(DQuat),
    /// Steady about an axis of the world, after a first rotation.
    Spin {
        axis: DVec3,
        rate: f64,
        first: DQuat,
    },
    /// The thing's x axis along the track's horizontal direction.
    Ahead,
    /// A ball of this radius that rolls along its track.
    Roll(f64),
}

/// A number that changes over time.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Angle {
    /// `mean + by sin(rate t + phase)`
    Sine { mean: f64, by: f64, rate: f64, phase: f64 },
    /// `rate t + phase`
    Steady { rate: f64, phase: f64 },
    /// From one value to the other between two seconds, and there it stays.
    Once { from: f64, to: f64, seconds: [f64; 2] },
}

impl Angle {
    pub(crate) fn at(&self, t: f64) -> f64 {
        match *self {
            Self::Sine { mean, by, rate, phase } => mean + by * (rate * t + phase).sin(),
            Self::Steady { rate, phase } => rate * t + phase,
            Self::Once { from, to, seconds: [start, end] } => {
                let s = ((t - start) / (end - start).max(1e-9)).clamp(0.0, 1.0);
                from + (to - from) * s * s * (3.0 - 2.0 * s)
            }
        }
    }
}

/// When a thing moves: its own time is 0 until `start` and does not go on after `stop`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    pub(crate) start: f64,
    pub(crate) stop: f64,
}

impl Clock {
    pub(crate) const ALWAYS: Self = Self { start: f64::NEG_INFINITY, stop: f64::INFINITY };

    fn at(self, t: f64) -> f64 {
        if self.start.is_finite() {
            t.clamp(self.start, self.stop.max(self.start)) - self.start
        } else {
            t.min(self.stop)
        }
    }
}

/// The pose of a thing as a whole.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    pub(crate) track: Track,
    pub(crate) turn: Turn,
    pub(crate) clock: Clock,
}

/// One degree of freedom between a part and the one it hangs on.
#[derive(Debug, Clone)]
pub(crate) struct Joint {
    /// An earlier joint, or the root.
    pub(crate) parent: Option<usize>,
    /// Where the joint sits on its parent.
    pub(crate) place: DVec3,
    pub(crate) axis: DVec3,
    pub(crate) angle: Angle,
    /// Slides along the axis in place of turning about it.
    pub(crate) slides: bool,
}

impl Track {
    fn at(&self, t: f64) -> DVec3 {
        match self {
            Self::Fixed(point) => *point,
            Self::Spline { points, seconds } => spline(points, t / seconds),
            Self::Thrown { from, velocity, floor, bounce } => thrown(*from, *velocity, *floor, *bounce, t),
            Self::Swing { pivot, arm, axis, angle } => {
                *pivot + DQuat::from_axis_angle(*axis, angle.at(t)) * DVec3::new(0.0, 0.0, -arm)
            }
            Self::Hover { centre, by, rate, phase } => {
                let wave = |k: f64| (rate * k * t + phase * k).sin();
                *centre + *by * DVec3::new(wave(0.71), wave(0.83), wave(1.0))
            }
        }
    }
}

impl Motion {
    pub(crate) fn fixed(point: DVec3) -> Self {
        Self { track: Track::Fixed(point), turn: Turn::Fixed(DQuat::IDENTITY), clock: Clock::ALWAYS }
    }

    /// The pose at a time.
    pub(crate) fn at(&self, t: f64) -> DAffine3 {
        let t = self.clock.at(t);
        let point = self.track.at(t);
        let rotation = match &self.turn {
            Turn::Fixed(rotation) => *rotation,
            Turn::Spin { axis, rate, first } => DQuat::from_axis_angle(*axis, rate * t) * *first,
            Turn::Ahead => {
                let ahead = self.track.at(t + 0.02) - self.track.at(t - 0.02);
                // At the ends of its track a thing looks where it came from or will go.
                let ahead = if ahead.truncate().length() > 1e-9 { ahead } else { self.ends() };
                DQuat::from_rotation_z(ahead.y.atan2(ahead.x))
            }
            Turn::Roll(radius) => {
                // Turned in small steps along the way: exact enough to look right, and a rigid pose in any case.
                let mut rotation = DQuat::IDENTITY;
                const STEPS: usize = 32;
                let mut before = self.track.at(0.0);
                for k in 1..=STEPS {
                    let now = self.track.at(t * k as f64 / STEPS as f64);
                    let way = (now - before).with_z(0.0);
                    if let Some(direction) = way.try_normalize() {
                        rotation = DQuat::from_axis_angle(DVec3::Z.cross(direction), way.length() / radius) * rotation;
                    }
                    before = now;
                }
                rotation.normalize()
            }
        };
        let rotation = match &self.track {
            Track::Swing { axis, angle, .. } => DQuat::from_axis_angle(*axis, angle.at(t)) * rotation,
            _ => rotation,
        };
        DAffine3::from_rotation_translation(rotation, point)
    }

    fn ends(&self) -> DVec3 {
        match &self.track {
            Track::Spline { points, .. } => {
                *points.last().unwrap_or(&DVec3::X) - *points.first().unwrap_or(&DVec3::ZERO)
            }
            _ => DVec3::X,
        }
    }

    pub(crate) fn local_time(&self, t: f64) -> f64 {
        self.clock.at(t)
    }
}

/// Poses of all joints, in the world.
pub(crate) fn joint_poses(root: DAffine3, joints: &[Joint], t: f64) -> Vec<DAffine3> {
    let mut poses: Vec<DAffine3> = Vec::with_capacity(joints.len());
    for joint in joints {
        let parent = joint.parent.map_or(root, |parent| poses[parent]);
        let amount = joint.angle.at(t);
        let own = if joint.slides {
            DAffine3::from_translation(joint.place + joint.axis * amount)
        } else {
            DAffine3::from_rotation_translation(DQuat::from_axis_angle(joint.axis, amount), joint.place)
        };
        poses.push(parent * own);
    }
    poses
}

/// A Catmull-Rom spline over [0, 1] through all points; beyond, its ends.
pub(crate) fn spline(points: &[DVec3], s: f64) -> DVec3 {
    let Some(last) = points.len().checked_sub(1).filter(|&last| last > 0) else {
        return points.first().copied().unwrap_or(DVec3::ZERO);
    };
    let x = s.clamp(0.0, 1.0) * last as f64;
    let k = (x as usize).min(last - 1);
    let f = x - k as f64;
    let (b, c) = (points[k], points[k + 1]);
    let a = if k == 0 { b * 2.0 - c } else { points[k - 1] };
    let d = if k + 2 > last { c * 2.0 - b } else { points[k + 2] };
    b + (c - a) * 0.5 * f
        + (a * 2.0 - b * 5.0 + c * 4.0 - d) * 0.5 * f * f
        + (b * 3.0 - a - c * 3.0 + d) * 0.5 * f * f * f
}

/// Flights between bounces.
fn thrown(from: DVec3, velocity: DVec3, floor: f64, bounce: f64, t: f64) -> DVec3 {
    let (mut from, mut velocity, mut left) = (from, velocity, t.max(0.0));
    for _ in 0..12 {
        // The later root of z + v t - g t^2 / 2 = floor.
        let height = (from.z - floor).max(0.0);
        let flight = (velocity.z + (velocity.z * velocity.z + 2.0 * GRAVITY * height).sqrt()) / GRAVITY;
        if left < flight {
            return from + velocity * left - DVec3::Z * 0.5 * GRAVITY * left * left;
        }
        left -= flight;
        from += velocity * flight - DVec3::Z * 0.5 * GRAVITY * flight * flight;
        from.z = floor;
        velocity = DVec3::new(velocity.x * 0.8, velocity.y * 0.8, (GRAVITY * flight - velocity.z) * bounce);
        if velocity.z < 0.3 {
            break;
        }
    }
    from
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thrown_thing_bounces_above_the_floor_and_rests() {
        let at = |t| thrown(DVec3::new(0.0, 0.0, 1.5), DVec3::new(1.0, 0.0, 2.0), 0.1, 0.6, t);
        let mut before = at(0.0);
        for k in 1..2000 {
            let now = at(f64::from(k) * 0.005);
            assert!(now.z >= 0.1 - 1e-9 && now.distance(before) < 0.06, "{k}: {now}");
            before = now;
        }
        assert_eq!(at(50.0), at(60.0));
    }

    #[test]
    fn splines_pass_through_their_points() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 2.0, 0.0), DVec3::Z];
        for (k, point) in points.iter().enumerate() {
            assert!(spline(&points, k as f64 / 3.0).distance(*point) < 1e-12);
        }
        assert_eq!(spline(&points, -1.0), points[0]);
        assert_eq!(spline(&points[..1], 0.3), points[0]);
        assert_eq!(spline(&[], 0.3), DVec3::ZERO);
    }

    #[test]
    fn a_late_clock_holds_the_first_pose() {
        let track = Track::Spline { points: vec![DVec3::ZERO, DVec3::X], seconds: 1.0 };
        let motion = Motion { track, turn: Turn::Ahead, clock: Clock { start: 0.5, stop: 1.0 } };
        assert_eq!(motion.at(0.0), motion.at(0.5));
        assert!((motion.at(2.0).translation.x - 0.5).abs() < 1e-12);
    }
}
