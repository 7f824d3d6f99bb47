//! Why cameras and samples are refused and drawn again, as the paper cleans its data.

use std::fmt;

use crate::cast::{Geometry, Hit};
use crate::labels::{is_outside, is_seen};
use crate::view::View;

/// Mean of a picture's bytes below which it is too dark, and part of its bytes at the ends of their range.
const DARKEST: f64 = 22.0;
const BURNT: f64 = 0.45;
/// Part of an image's points that another image must show.
const OVERLAP: f64 = 0.12;

/// Why a camera or a sample is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Refusal {
    /// A camera is too near to something.
    Near,
    /// A camera is inside of something.
    Inside,
    /// A camera sees little but the sky.
    Sky,
    /// A near thing blocks a camera's view.
    Blocked,
    /// All that a camera sees is at one distance.
    Flat,
    /// A camera sees few things.
    Bare,
    /// Little that moves is in view.
    Still,
    /// Images show different parts of the scene.
    Apart,
    /// A picture is too dark.
    Dark,
    /// A picture is black or white in large parts.
    Burnt,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Near => "a camera is too near to something",
            Self::Inside => "a camera is inside of something",
            Self::Sky => "a camera sees little but the sky",
            Self::Blocked => "a camera's view is blocked",
            Self::Flat => "all that a camera sees is at one distance",
            Self::Bare => "a camera sees few things",
            Self::Still => "little that moves is in view",
            Self::Apart => "images show different parts of the scene",
            Self::Dark => "a picture is too dark",
            Self::Burnt => "a picture is black or white in large parts",
        })
    }
}

/// Refuses pictures that are too dark or have lost their colours.
pub(crate) fn judge_colours(colours: &[u8]) -> Result<(), Refusal> {
    let count = colours.len().max(1) as f64;
    let mean = colours.iter().map(|&v| f64::from(v)).sum::<f64>() / count;
    if mean < DARKEST {
        return Err(Refusal::Dark);
    }
    let ends = colours.iter().filter(|v| !(3..=252).contains(*v)).count() as f64;
    if ends > BURNT * count { Err(Refusal::Burnt) } else { Ok(()) }
}

/// Refuses scenes with movers where less than this part of the pixels shows something that moves. At one time alone nothing can be seen to
/// move.
pub(crate) fn judge_motion(least: f64, times: usize, moving: usize, pixels: usize) -> Result<(), Refusal> {
    let enough = times <= 1 || moving as f64 >= least * pixels as f64;
    if enough { Ok(()) } else { Err(Refusal::Still) }
}

/// Refuses images that fall into groups which show nothing of each other's points.
pub(crate) fn judge_overlap(images: &[(&View, &Geometry, &[Option<Hit>])]) -> Result<(), Refusal> {
    let shows = |from: usize, to: usize| {
        let ((own, geometry, hits), (view, then, _)) = (images[from], images[to]);
        // A hundred points tell.
        let step = (hits.len() / 100).max(1) | 1;
        let points = hits.iter().step_by(step).flatten();
        let (mut seen, mut count) = (0.0, 0.0);
        for hit in points {
            count += 1.0;
            seen += f64::from(u8::from(is_seen(view, then, hit, is_outside(own, geometry, hit))));
        }
        count > 0.0 && seen >= OVERLAP * count
    };
    let mut reached = vec![false; images.len()];
    let mut waiting = vec![0];
    while let Some(from) = waiting.pop() {
        reached[from] = true;
        waiting.extend((0..images.len()).filter(|&to| !reached[to] && (shows(from, to) || shows(to, from))));
    }
    if reached.contains(&false) { Err(Refusal::Apart) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_that_hardly_move_are_refused_unless_they_have_one_time() {
        assert_eq!(judge_motion(0.01, 4, 9, 1000), Err(Refusal::Still));
        assert_eq!((judge_motion(0.01, 4, 10, 1000), judge_motion(0.01, 1, 0, 1000)), (Ok(()), Ok(())));
    }

    #[test]
    fn dark_and_burnt_pictures_are_refused() {
        assert_eq!(judge_colours(&[10; 300]), Err(Refusal::Dark));
        assert_eq!(judge_colours(&[255; 300]), Err(Refusal::Burnt));
        assert_eq!(judge_colours(&[120; 300]), Ok(()));
    }
}
