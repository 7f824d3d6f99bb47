//! Which images make a sample: of which camera, when, and what the network is told of them.

use crate::random::Random;
use crate::recipe::Inputs;

/// A kind of input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Input {
    /// Images of one camera.
    OneCamera,
    /// Two videos of two cameras, one after the other in time.
    Videos,
    /// Photographs of several cameras at one time, then a video.
    Photographs,
}

const ALL: [Input; 3] = [Input::OneCamera, Input::Videos, Input::Photographs];

impl Input {
    /// The kind of the sample with an index, where kinds come in turn.
    #[must_use]
    pub const fn in_turn(index: u64) -> Self {
        ALL[(index % 3) as usize]
    }

    /// Its name in folders and tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OneCamera => "one-camera",
            Self::Videos => "videos",
            Self::Photographs => "photographs",
        }
    }
}

/// One image that is wanted: which of the scene's cameras takes it, and when.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shot {
    pub(crate) rig: usize,
    pub(crate) moment: usize,
    pub(crate) video: u32,
    pub(crate) frame: u32,
}

/// The images of a sample with this index (`spec/omnix.md` 11.4). Fewer than three are of one camera.
pub(crate) fn shots(random: &mut Random, count: usize, frames: usize, inputs: Inputs, index: u64) -> Vec<Shot> {
    let step = random.count(1, 2).min((frames - 1) / count.max(1)).max(1);
    let span = (count - 1) * step + 1;
    let first = random.below(frames.saturating_sub(span) + 1);
    let moment = |k: usize| (first + k * step).min(frames - 1);
    let one = |k: usize| Shot { rig: 0, moment: moment(k), video: 0, frame: (k * step) as u32 };
    if count < 3 {
        return (0..count).map(one).collect();
    }
    let input = match inputs {
        Inputs::Drawn => ALL[random.weighted(&[0.7, 0.15, 0.15])],
        Inputs::InTurn => Input::in_turn(index),
    };
    match input {
        Input::OneCamera => (0..count).map(one).collect(),
        Input::Videos => {
            let half = count.div_ceil(2);
            let second = |k: usize| Shot { rig: 1, video: 1, frame: ((k - half) * step) as u32, ..one(k) };
            (0..count).map(|k| if k < half { one(k) } else { second(k) }).collect()
        }
        Input::Photographs => {
            let photos = random.count(1, (count - 2).min(6));
            let photo = |k: usize| Shot { rig: k + 1, moment: moment(0), video: k as u32, frame: 0 };
            let video = |k: usize| Shot {
                video: photos as u32,
                frame: ((k - photos) * step) as u32,
                moment: moment(k - photos),
                rig: 0,
            };
            (0..count).map(|k| if k < photos { photo(k) } else { video(k) }).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_in_turn_tell_the_network_what_they_are() {
        for index in 0..30 {
            let mut random = Random::new(3, index, "shots");
            let shots = shots(&mut random, 8, 20, Inputs::InTurn, index);
            let videos: Vec<u32> = shots.iter().map(|shot| shot.video).collect();
            let moments: Vec<usize> = shots.iter().map(|shot| shot.moment).collect();
            assert!(shots.len() == 8 && moments.iter().all(|&moment| moment < 20));
            match Input::in_turn(index) {
                Input::OneCamera => assert!(videos == [0; 8] && moments.is_sorted()),
                Input::Videos => assert!(videos == [0, 0, 0, 0, 1, 1, 1, 1] && moments.is_sorted()),
                Input::Photographs => {
                    let photos = videos[7] as usize;
                    assert!((1..=6).contains(&photos) && moments[..=photos].iter().all(|&m| m == moments[0]));
                    assert!(videos[..photos].iter().enumerate().all(|(k, &video)| video as usize == k));
                }
            }
        }
    }

    #[test]
    fn drawn_kinds_have_their_shares() {
        let mut most = [0; 3];
        for index in 0..1000 {
            let shots = shots(&mut Random::new(3, index, "shots"), 8, 20, Inputs::Drawn, index);
            let kind = match (shots[7].video, shots[1].rig) {
                (0, _) => 0,
                (1, 0) => 1,
                _ => 2,
            };
            most[kind] += 1;
        }
        assert!((650..750).contains(&most[0]) && most[1] > 110 && most[2] > 110, "{most:?}");
    }
}
