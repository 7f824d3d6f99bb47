//! Where things move.

use glam::{DQuat, DVec2, DVec3};

use crate::motion::{Clock, Motion, Track, Turn};
use crate::random::Random;
use crate::things::walker::way;

/// Where things move, and for how long.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arena {
    /// The rectangle on the floor.
    pub(crate) low: DVec2,
    pub(crate) high: DVec2,
    pub(crate) floor: f64,
    /// Height of the space above the floor.
    pub(crate) tall: f64,
    /// Of the scene.
    pub(crate) seconds: f64,
    /// Arena widths a second: from slow to fast.
    pub(crate) speed: [f64; 2],
    /// Whether people fit.
    pub(crate) people: bool,
}

impl Arena {
    pub(crate) fn width(&self) -> f64 {
        (self.high - self.low).min_element()
    }

    pub(crate) fn middle(&self) -> DVec3 {
        ((self.low + self.high) / 2.0).extend(self.floor)
    }

    pub(crate) fn point(&self, random: &mut Random, z: [f64; 2]) -> DVec3 {
        random.inside(self.low, self.high).extend(self.floor + self.tall * random.within(z))
    }

    /// Metres that a thing goes while the scene lasts.
    pub(crate) fn distance(&self, random: &mut Random) -> f64 {
        random.log_range(self.speed[0], self.speed[1]) * self.width() * self.seconds
    }

    pub(crate) fn clock(&self, random: &mut Random) -> Clock {
        if random.chance(0.7) {
            return Clock::ALWAYS;
        }
        let start = random.range(0.0, 0.4) * self.seconds;
        Clock { start, stop: start + random.range(0.4, 1.0) * self.seconds }
    }

    /// Of a thing that moves.
    pub(crate) fn size(&self, random: &mut Random) -> f64 {
        self.width() * random.log_range(0.1, 0.35)
    }

    /// On the floor at a speed in metres a second; at 0, standing somewhere.
    pub(crate) fn strolling(&self, random: &mut Random, speed: f64) -> Motion {
        let length = speed * self.seconds;
        if speed == 0.0 {
            let turn = Turn::Fixed(DQuat::from_rotation_z(random.range(0.0, 6.3)));
            return Motion { track: Track::Fixed(self.point(random, [0.0, 0.0])), turn, clock: Clock::ALWAYS };
        }
        let points = way(random, self.low, self.high, self.floor, length);
        Motion { track: Track::Spline { points, seconds: self.seconds }, turn: Turn::Ahead, clock: Clock::ALWAYS }
    }
}
