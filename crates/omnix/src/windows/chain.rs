//! Windows joined to parts of the film, each with one world.

use std::ops::Range;
use std::path::Path;

use omnix_geometry::{Join, JoinError, Seen, Shared, Similarity};

use super::layout::Layout;
use super::stored::{StoredWindow, window_path};
use crate::error::OmnixError;

/// Two windows are joined if, for half of the points and more, the two places of a point are at most this far apart, in parts of its
/// depth.
pub const MOST_APART: f64 = 0.1;

/// Why two neighbouring windows were not joined.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Apart {
    /// The film is cut between them.
    #[error("the film is cut there")]
    Cut,
    /// Nothing could be fitted.
    #[error(transparent)]
    Unfit(JoinError),
    /// The fit leaves too much.
    #[error("their points stay {:.0} % of the depth apart", 100.0 * .0.residual[0])]
    Disagree(Box<Join>),
}

/// What became of two neighbouring windows.
#[derive(Clone, Debug, PartialEq)]
pub struct Seam {
    /// Their numbers.
    pub windows: [usize; 2],
    /// The images that they share; none at a cut, where the range begins with the image after it.
    pub images: Range<usize>,
    /// How they were joined, or why not.
    pub outcome: Result<Join, Apart>,
}

/// Where a window lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The part of the film that it belongs to, from 0.
    pub part: usize,
    /// From the window's world to the part's, which is that of the part's first window.
    pub to_part: Similarity,
}

/// All windows of a film in their places.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    placements: Vec<Placement>,
    seams: Vec<Seam>,
    parts: Vec<Range<usize>>,
}

impl Chain {
    /// Joins the windows in `folder`, of images of `[height, width]`. Pixels whose motion score is above `still` are left out; without that
    /// number all count. `each` is called before each of the seams.
    ///
    /// # Errors
    /// A window that cannot be read, or of `each`.
    pub fn new(
        layout: &Layout,
        folder: &Path,
        size: [usize; 2],
        still: Option<f32>,
        each: &mut dyn FnMut(usize) -> Result<(), OmnixError>,
    ) -> Result<Self, OmnixError> {
        let mut seams = Vec::new();
        let open = |k: usize| StoredWindow::open(&window_path(folder, k), size);
        for k in 0..layout.windows().len().saturating_sub(1) {
            each(k)?;
            let images = layout.shared(k);
            let outcome = if images.is_empty() {
                Err(Apart::Cut)
            } else {
                let begins = [k, k + 1].map(|k| layout.windows()[k].images.start);
                judge(join([open(k)?, open(k + 1)?], begins, images.clone(), size, still)?)
            };
            seams.push(Seam { windows: [k, k + 1], images, outcome });
        }
        Ok(Self::of(layout, seams))
    }

    /// The places that follow from the seams.
    fn of(layout: &Layout, seams: Vec<Seam>) -> Self {
        let mut at = Placement { part: 0, to_part: Similarity::IDENTITY };
        let mut placements = vec![at];
        for seam in &seams {
            at = match &seam.outcome {
                Ok(join) => Placement { to_part: at.to_part.after(&join.similarity), ..at },
                Err(_) => Placement { part: at.part + 1, to_part: Similarity::IDENTITY },
            };
            placements.push(at);
        }
        Self { seams, ..Self::placed(layout, placements) }
    }

    /// Windows in known places, without what is known of their seams.
    pub(super) fn placed(layout: &Layout, placements: Vec<Placement>) -> Self {
        let (mut parts, mut begin) = (Vec::new(), 0);
        for (k, pair) in placements.windows(2).enumerate() {
            if pair[0].part != pair[1].part {
                // The earlier window keeps the first half of what they share.
                let shared = layout.shared(k);
                let border = shared.start + shared.len().div_ceil(2);
                parts.push(begin..border);
                begin = border;
            }
        }
        parts.push(begin..layout.images());
        Self { placements, seams: Vec::new(), parts }
    }

    /// Each window's place.
    #[must_use]
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// What became of each two neighbouring windows.
    #[must_use]
    pub fn seams(&self) -> &[Seam] {
        &self.seams
    }

    /// The images of each part of the film: one if all windows were joined.
    #[must_use]
    pub fn parts(&self) -> &[Range<usize>] {
        &self.parts
    }
}

/// What two windows, which begin with these images of the film, say of images that they share.
fn join(
    windows: [StoredWindow; 2],
    begins: [usize; 2],
    images: Range<usize>,
    size: [usize; 2],
    still: Option<f32>,
) -> Result<Result<Join, JoinError>, OmnixError> {
    let mut shared = Shared::default();
    for image in images {
        let [earlier, later] = [0, 1].map(|k| windows[k].image(image - begins[k]));
        let sides = [earlier?, later?];
        let still = sides.each_ref().map(|side| {
            let theta = side.theta.as_ref().zip(still);
            // A score that is no number says nothing of stillness.
            theta.map(|(theta, most)| theta.iter().map(|theta| *theta <= most).collect::<Vec<bool>>())
        });
        let [earlier, later] = [0, 1].map(|k| Seen {
            depth: &sides[k].depth,
            confidence: &sides[k].confidence,
            still: still[k].as_deref(),
            camera: sides[k].camera,
        });
        shared.add(size, &earlier, &later)?;
    }
    Ok(shared.fit())
}

fn judge(fit: Result<Join, JoinError>) -> Result<Join, Apart> {
    match fit {
        Ok(join) if join.residual[0] <= MOST_APART => Ok(join),
        Ok(join) => Err(Apart::Disagree(Box::new(join))),
        Err(error) => Err(Apart::Unfit(error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seam(k: usize, layout: &Layout, outcome: Result<f64, Apart>) -> Seam {
        let join = |scale| Join {
            similarity: Similarity { scale, ..Similarity::IDENTITY },
            images: 2,
            points: 100,
            still: 1.0,
            residual: [0.0; 2],
            depth_residual: 0.0,
            turned: [0.0; 2],
            moved: [0.0; 2],
        };
        Seam { windows: [k, k + 1], images: layout.shared(k), outcome: outcome.map(join) }
    }

    #[test]
    fn places_are_chained_and_a_part_begins_where_nothing_is_joined() {
        let layout = Layout::new(22, 8, 3, &[18]).unwrap();
        let apart = Apart::Unfit(JoinError::Degenerate);
        let seams = vec![seam(0, &layout, Ok(2.0)), seam(1, &layout, Err(apart)), seam(2, &layout, Err(Apart::Cut))];
        let windows: Vec<_> = layout.windows().iter().map(|window| window.images.clone()).collect();
        assert_eq!(windows, [0..8, 5..13, 10..18, 18..22]);
        let chain = Chain::of(&layout, seams);
        assert_eq!(chain.parts(), [0..12, 12..18, 18..22]);
        let places: Vec<(usize, f64)> = chain.placements().iter().map(|p| (p.part, p.to_part.scale)).collect();
        assert_eq!(places, [(0, 1.0), (0, 2.0), (1, 1.0), (2, 1.0)]);
    }
}
