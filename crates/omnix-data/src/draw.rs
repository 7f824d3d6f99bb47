//! Which images of a scene make a sample (`spec/omnix.md` 11.4): a function of (seed, index) and of the scene's videos.
//!
//! * *One camera*: consecutive images of one video, 1 to `step` frames apart.
//! * *Several videos*: 2 or 3 clips of different cameras one after the other in time, with 3 frames from the last image of one to the first
//!   of the next; lengths are random, each at least half of an equal share.
//! * *Photographs and a video*: 1 to 6 images of other cameras at one moment of the clip, each a video of its own, then one video.
//! * *Photographs*: random images of a scene in which nothing moves, each a video of its own.
//!
//! The network is told videos in this order from 0, and the number of each image in its clip from 0. Frame steps inside of the clips of
//! several videos are 1, which the specification does not say.

use crate::DataError;
use crate::random::Random;
use crate::scene::{Pick, Video};
use crate::set::Set;

/// Frames from the last image of a clip to the first of the next.
const APART: usize = 3;
/// Photographs before a video, at most.
const PHOTOS: usize = 6;
/// What the random numbers are for.
const PURPOSE: u64 = 1;

/// How samples of a set are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rule {
    /// Shares of one camera, of several videos, and of photographs and a video; the rest is 0.
    pub shares: [f64; 3],
    /// Largest step between the frames of one camera.
    pub step: usize,
    /// Random photographs of a still scene, in place of all that.
    pub still: bool,
}

impl Rule {
    /// The rule of a data set.
    #[must_use]
    pub const fn of(set: Set) -> Self {
        let shares = match set {
            Set::Ue | Set::Shared => [0.70, 0.15, 0.15],
            Set::Waymo => [0.70, 0.30, 0.0],
            _ => [1.0, 0.0, 0.0],
        };
        Self { shares, step: 2, still: matches!(set, Set::Dl3dv) }
    }
}

/// Draws the images of sample `index`. What a scene has too few cameras or frames for is replaced by one camera, and a step that its videos
/// are too short for by a smaller one.
///
/// # Errors
/// No image asked for, or a scene without a video of that number of images (for photographs and a video: of that number less the photographs).
pub fn draw(videos: &[Video], rule: &Rule, count: usize, seed: u64, index: u64) -> Result<Vec<Pick>, DataError> {
    let mut random = Random::new(seed, index, PURPOSE);
    if rule.still {
        return photographs(videos, count, &mut random);
    }
    let [_, several, photos] = rule.shares;
    let kind = random.unit();
    let drawn = if kind < several {
        clips(videos, count, &mut random)
    } else if kind < several + photos {
        photos_and_video(videos, rule.step, count, &mut random)
    } else {
        None
    };
    drawn.or_else(|| one_camera(videos, rule.step, count, &mut random)).ok_or_else(|| too_few(videos, count))
}

fn too_few(videos: &[Video], count: usize) -> DataError {
    DataError::TooFewFrames { wanted: count, longest: videos.iter().map(|video| video.frames).max().unwrap_or(0) }
}

/// A clip of one video: (video, its frames).
fn clip(
    videos: &[usize],
    frames: &[Video],
    step: usize,
    count: usize,
    random: &mut Random,
) -> Option<(usize, Vec<usize>)> {
    let long: Vec<usize> = videos.iter().copied().filter(|video| frames[*video].frames >= count).collect();
    let video = *long.get(random.below(long.len()))?;
    let last = count.checked_sub(1)?;
    let most = (frames[video].frames - 1).checked_div(last).unwrap_or(1);
    let step = 1 + random.below(step.min(most).max(1));
    let start = random.below(frames[video].frames - last * step);
    Some((video, (0..count).map(|k| start + k * step).collect()))
}

fn one_camera(videos: &[Video], step: usize, count: usize, random: &mut Random) -> Option<Vec<Pick>> {
    let all: Vec<usize> = (0..videos.len()).collect();
    let (video, frames) = clip(&all, videos, step, count, random)?;
    Some(told(video, &frames, 0).collect())
}

/// The images of a clip with what the network is told.
fn told(video: usize, frames: &[usize], as_video: u32) -> impl Iterator<Item = Pick> {
    frames.iter().enumerate().map(move |(k, frame)| Pick { video, frame: *frame, as_video, as_frame: k as u32 })
}

fn clips(videos: &[Video], count: usize, random: &mut Random) -> Option<Vec<Pick>> {
    let number = 2 + random.below(2);
    let number = number.min(videos.len());
    if number < 2 || count < number {
        return None;
    }
    // At least half of an equal share each, the rest at random.
    let least = (count / (2 * number)).max(1);
    let mut lengths = vec![least; number];
    for _ in 0..count - least * number {
        lengths[random.below(number)] += 1;
    }
    let span = count + (number - 1) * (APART - 1);
    let cameras = random.some(number, videos.len());
    let shortest = cameras.iter().map(|camera| videos[*camera].frames).min()?;
    let mut next = random.below(shortest.checked_sub(span)? + 1);
    let mut picks = Vec::with_capacity(count);
    for (k, (camera, length)) in cameras.into_iter().zip(lengths).enumerate() {
        let frames: Vec<usize> = (next..next + length).collect();
        picks.extend(told(camera, &frames, k as u32));
        next += length - 1 + APART;
    }
    Some(picks)
}

fn photos_and_video(videos: &[Video], step: usize, count: usize, random: &mut Random) -> Option<Vec<Pick>> {
    let most = PHOTOS.min(videos.len().checked_sub(1)?).min(count.checked_sub(1)?);
    if most == 0 {
        return None;
    }
    let photos = 1 + random.below(most);
    let all: Vec<usize> = (0..videos.len()).collect();
    let (video, frames) = clip(&all, videos, step, count - photos, random)?;
    let moment = frames[random.below(frames.len())];
    let others: Vec<usize> = all.into_iter().filter(|k| *k != video && videos[*k].frames > moment).collect();
    if others.len() < photos {
        return None;
    }
    let cameras = random.some(photos, others.len());
    let single =
        |(k, other): (usize, usize)| Pick { video: others[other], frame: moment, as_video: k as u32, as_frame: 0 };
    let mut picks: Vec<Pick> = cameras.into_iter().enumerate().map(single).collect();
    picks.extend(told(video, &frames, photos as u32));
    Some(picks)
}

fn photographs(videos: &[Video], count: usize, random: &mut Random) -> Result<Vec<Pick>, DataError> {
    let all: Vec<(usize, usize)> =
        videos.iter().enumerate().flat_map(|(v, video)| (0..video.frames).map(move |f| (v, f))).collect();
    if count == 0 || all.len() < count {
        return Err(DataError::TooFewFrames { wanted: count, longest: all.len() });
    }
    let single = |(k, at): (usize, usize)| Pick { video: all[at].0, frame: all[at].1, as_video: k as u32, as_frame: 0 };
    Ok(random.some(count, all.len()).into_iter().enumerate().map(single).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras(count: usize, frames: usize) -> Vec<Video> {
        (0..count).map(|k| Video { name: format!("cam_{k:02}"), frames }).collect()
    }

    const RULE: Rule = Rule::of(Set::Ue);

    /// (number of videos that the network is told, whether all but the last are photographs).
    fn kind(picks: &[Pick]) -> &'static str {
        let videos = picks.last().unwrap().as_video;
        let first = picks.iter().filter(|p| p.as_video == 0).count();
        match (videos, first) {
            (0, _) => "camera",
            (_, 1) if picks.iter().filter(|p| p.as_video < videos).all(|p| p.frame == picks[0].frame) => "photos",
            _ => "clips",
        }
    }

    #[test]
    fn the_shares_are_those_of_the_paper_and_draws_are_functions() {
        let videos = cameras(16, 60);
        let mut counts = [0; 3];
        for index in 0..2000 {
            let picks = draw(&videos, &RULE, 16, 5, index).unwrap();
            assert_eq!(picks, draw(&videos, &RULE, 16, 5, index).unwrap());
            assert_eq!(picks.len(), 16);
            counts[["camera", "clips", "photos"].iter().position(|k| *k == kind(&picks)).unwrap()] += 1;
        }
        let near = |count: usize, share: f64| (count as f64 / 2000.0 - share).abs() < 0.025;
        assert!(near(counts[0], 0.70) && near(counts[1], 0.15) && near(counts[2], 0.15), "{counts:?}");
    }

    #[test]
    fn one_camera_has_even_steps() {
        let videos = cameras(1, 40);
        let mut steps = [0; 3];
        for index in 0..300 {
            let picks = draw(&videos, &RULE, 16, 1, index).unwrap();
            let step = picks[1].frame - picks[0].frame;
            assert!(picks.windows(2).all(|w| w[1].frame - w[0].frame == step && w[1].as_frame == w[0].as_frame + 1));
            steps[step] += 1;
        }
        assert!(steps[0] == 0 && steps[1] > 100 && steps[2] > 100, "{steps:?}");
        // 20 frames are too few for 16 images two apart.
        assert!((0..50).all(|i| draw(&cameras(1, 20), &RULE, 16, 1, i).unwrap()[15].frame < 20));
        assert_eq!(draw(&cameras(3, 1), &RULE, 1, 1, 1).unwrap().len(), 1);
    }

    #[test]
    fn clips_follow_each_other_three_frames_apart() {
        let rule = Rule { shares: [0.0, 1.0, 0.0], ..RULE };
        for index in 0..200 {
            let picks = draw(&cameras(5, 24), &rule, 16, 3, index).unwrap();
            let number = picks[15].as_video as usize + 1;
            assert!(number == 2 || number == 3);
            for pair in picks.windows(2) {
                let same = pair[0].as_video == pair[1].as_video;
                assert_eq!(
                    (pair[0].video == pair[1].video, pair[1].frame - pair[0].frame),
                    (same, if same { 1 } else { 3 })
                );
            }
            for video in 0..number as u32 {
                let length = picks.iter().filter(|p| p.as_video == video).count();
                assert!(length >= 16 / (2 * number), "{picks:?}");
            }
        }
    }

    #[test]
    fn photographs_come_first_and_are_of_one_moment() {
        let rule = Rule { shares: [0.0, 0.0, 1.0], ..RULE };
        let mut numbers = [0; 8];
        for index in 0..300 {
            let picks = draw(&cameras(9, 40), &rule, 16, 3, index).unwrap();
            let photos = picks[15].as_video as usize;
            numbers[photos] += 1;
            let (front, video) = picks.split_at(photos);
            assert!(front.iter().enumerate().all(|(k, p)| (p.as_video, p.as_frame) == (k as u32, 0)));
            assert!(front.iter().all(|p| p.frame == front[0].frame && p.video != video[0].video));
            assert!(video.iter().any(|p| p.frame == front[0].frame));
            assert_eq!(video[0].as_frame, 0);
        }
        assert!(numbers[0] == 0 && numbers[7] == 0 && numbers[1..7].iter().all(|n| *n > 20), "{numbers:?}");
    }

    #[test]
    fn still_scenes_give_photographs() {
        let picks = draw(&cameras(1, 30), &Rule::of(Set::Dl3dv), 16, 0, 0).unwrap();
        let mut frames: Vec<usize> = picks.iter().map(|p| p.frame).collect();
        frames.sort_unstable();
        frames.dedup();
        assert_eq!((frames.len(), picks[15].as_video, picks[15].as_frame), (16, 15, 0));
    }

    #[test]
    fn too_short_scenes_are_errors() {
        for (videos, count) in [(cameras(0, 0), 4), (cameras(2, 2), 4), (cameras(2, 3), 0)] {
            for index in 0..20 {
                let error = draw(&videos, &RULE, count, 0, index).unwrap_err();
                assert!(matches!(error, DataError::TooFewFrames { .. }), "{error}");
            }
        }
        assert!(draw(&cameras(1, 3), &Rule::of(Set::Dl3dv), 4, 0, 0).is_err());
    }
}
