//! Where a film is cut: the picture changes at once, and only there.
//!
//! Two neighbouring pictures differ by half the sum of the differences of their colour histograms (8 levels a channel, 512 colours): 0
//! for the same colours, 1 for none in common. Motion of the camera or of things changes it little by little. A cut is a difference of
//! at least [`LEAST`] that is also [`TIMES`] as large as every other within [`NEAR`] pictures: photographs that all differ are no cuts,
//! and a flash, which differs before and after, is none.

use omnix_io::Picture;

/// Least difference.
const LEAST: f32 = 0.35;
/// How much larger than those near it.
const TIMES: f32 = 3.0;
/// Pictures that are near.
const NEAR: usize = 3;
const COLOURS: usize = 512;

/// Finds the cuts of a film whose pictures come in order. Holds one histogram, and one number for each picture.
#[derive(Clone, Debug, Default)]
pub struct Cuts {
    before: Option<(u32, Vec<f32>)>,
    /// Of each picture to the one before; none at the beginning of a video.
    differences: Vec<Option<f32>>,
}

impl Cuts {
    /// Takes the next picture, of this video.
    pub fn add(&mut self, video: u32, picture: &Picture) {
        let histogram = histogram(picture);
        let difference = self
            .before
            .as_ref()
            .filter(|(of, _)| *of == video)
            .map(|(_, before)| before.iter().zip(&histogram).map(|(a, b)| (a - b).abs()).sum::<f32>() / 2.0);
        self.differences.push(difference);
        self.before = Some((video, histogram));
    }

    /// The pictures that begin a shot, but for the first of each video.
    #[must_use]
    pub fn found(&self) -> Vec<usize> {
        let is_cut = |k: &usize| {
            let Some(difference) = self.differences[*k] else { return false };
            let near = (k.saturating_sub(NEAR)..=(k + NEAR).min(self.differences.len() - 1)).filter(|other| other != k);
            difference >= LEAST && near.filter_map(|other| self.differences[other]).all(|d| difference >= TIMES * d)
        };
        (0..self.differences.len()).filter(is_cut).collect()
    }
}

fn histogram(picture: &Picture) -> Vec<f32> {
    let mut counts = vec![0u32; COLOURS];
    let (pixels, _) = picture.data.as_chunks::<3>();
    for [r, g, b] in pixels {
        counts[usize::from(r >> 5) << 6 | usize::from(g >> 5) << 3 | usize::from(b >> 5)] += 1;
    }
    counts.into_iter().map(|count| count as f32 / pixels.len() as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of a ramp of one colour, moved by `shift`.
    fn picture(colour: [u8; 3], shift: usize) -> Picture {
        let at = |x: usize| colour.map(|c| (usize::from(c) * ((x + shift) % 32 + 32) / 64) as u8);
        Picture::new(32, 4, (0..128).flat_map(at).collect())
    }

    fn found(pictures: impl IntoIterator<Item = (u32, Picture)>) -> Vec<usize> {
        let mut cuts = Cuts::default();
        pictures.into_iter().for_each(|(video, picture)| cuts.add(video, &picture));
        cuts.found()
    }

    const RED: [u8; 3] = [250, 40, 10];
    const BLUE: [u8; 3] = [20, 60, 240];

    #[test]
    fn a_cut_is_found_and_motion_is_none() {
        let film = |cut_at: usize| (0..20).map(move |k| (0, picture(if k < cut_at { RED } else { BLUE }, k)));
        assert_eq!(found(film(9)), [9]);
        assert_eq!(found(film(20)), Vec::<usize>::new());
        assert_eq!(found(film(1)), [1]);
        assert_eq!(found(film(19)), [19]);
        // Every ten frames.
        assert_eq!(found((0..40).map(|k| (0, picture(if k / 10 % 2 == 0 { RED } else { BLUE }, k)))), [10, 20, 30]);
    }

    #[test]
    fn photographs_a_flash_and_the_next_video_are_no_cuts() {
        let colours = [RED, BLUE, [240, 240, 240], [10, 200, 10]];
        assert!(found((0..12).map(|k| (0, picture(colours[k % 4], 0)))).is_empty(), "photographs");
        assert!(found((0..12).map(|k| (0, picture(if k == 6 { BLUE } else { RED }, 0)))).is_empty(), "a flash");
        assert!(found((0..12).map(|k| (u32::from(k > 5), picture(if k > 5 { BLUE } else { RED }, 0)))).is_empty());
        assert!(found((0..9).map(|_| (0, picture([0; 3], 0)))).is_empty(), "black frames");
        assert!(found([]).is_empty());
    }
}
