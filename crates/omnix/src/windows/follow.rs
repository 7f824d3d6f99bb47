//! Points followed through the windows of a part, from window to window as long as they are seen.
//!
//! A point is a pixel of one image, followed at all times of its image's window by that window's field. Over a seam it goes where the next
//! window sees it: of the pixels of a shared image around the place where the point is projected to, the one whose own world point is nearest
//! to it, if that is nearer than [`NEAR`](super::view::NEAR) of the depth and the width of [`FOOTPRINT`](super::view::FOOTPRINT) pixels. From there the next window's field follows that
//! pixel; the small distance between the two points is kept, so that the path goes on where it was. Where it is not found in any shared
//! image (it has left the picture, or something is before it) the point is lost: its positions are NaN from there on. In shared images
//! its two paths go over into each other as depth does. Points go both ways, from the window of their image to the film's end and to its
//! beginning. Positions are in the part's world.

use std::ops::Range;

use omnix_geometry::Camera;
use omnix_io::output::{PointOptions, choose_points};

use super::chain::Chain;
use super::layout::Layout;
use super::view::View;
use crate::error::OmnixError;

/// Bytes of the positions that [`Follow::pixels`] keeps at a time.
const AT_ONCE: usize = 64 << 20;

/// What a window's field says, of images counted from the window's first.
pub trait WindowField {
    /// Motion scores of an image's pixels.
    ///
    /// # Errors
    /// A failure of reading.
    fn theta(&mut self, image: usize) -> Result<Vec<f32>, OmnixError>;

    /// Confidences of the paths of an image's pixels.
    ///
    /// # Errors
    /// A failure of reading.
    fn confidence(&mut self, image: usize) -> Result<Vec<f32>, OmnixError>;

    /// Whether a pixel of this score moves.
    fn moves(&self, theta: f32) -> bool;

    /// World points of an image's pixels at its own time, `[height, width, 3]`.
    ///
    /// # Errors
    /// A failure of reading.
    fn points(&mut self, image: usize) -> Result<Vec<f32>, OmnixError>;

    /// Where pixels (column, row) of an image are at all times of the window, `[times][pixels][3]`.
    ///
    /// # Errors
    /// Failures of the device or of reading.
    fn paths(&mut self, image: usize, pixels: &[[u32; 2]]) -> Result<Vec<f32>, OmnixError>;

    /// An image's camera.
    fn camera(&self, image: usize) -> Camera;
}

/// Opens the field of a window.
pub type OpenField<'a> = &'a mut dyn FnMut(usize) -> Result<Box<dyn WindowField>, OmnixError>;

/// Points of a part with their paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Followed {
    /// The film's image of each point, ascending.
    pub source: Vec<usize>,
    /// Column and row of each point in its image.
    pub pixel: Vec<[u32; 2]>,
    /// `[images of the part][points][3]`, NaN where a point is lost.
    pub positions: Vec<f32>,
    /// Motion score of each point's pixel.
    pub theta: Vec<f32>,
    /// Confidence of each point's path in its own window.
    pub confidence: Vec<f32>,
    /// Whether each point moves.
    pub moving: Vec<bool>,
}

/// A point where a window's field takes it up.
#[derive(Clone, Copy, Debug)]
struct Entry {
    point: usize,
    /// The film's image.
    image: usize,
    pixel: [u32; 2],
    /// What is added to the path, in the part's world.
    offset: [f32; 3],
}

/// The part of a film whose points are followed.
#[derive(Clone, Copy, Debug)]
pub struct Follow<'a> {
    /// The film's windows.
    pub layout: &'a Layout,
    /// Their places.
    pub chain: &'a Chain,
    /// Height and width of an image.
    pub size: [usize; 2],
    /// The part.
    pub part: usize,
}

impl Follow<'_> {
    /// Follows at most `budget` points, the moving ones of each window first, chosen by `seed`. `each` is called before every step with the
    /// steps done and all steps.
    ///
    /// # Errors
    /// Failures of `open` and of the fields it opens, or of `each`.
    pub fn points(
        &self,
        budget: usize,
        seed: u64,
        open: OpenField<'_>,
        each: &mut dyn FnMut(usize, usize) -> Result<(), OmnixError>,
    ) -> Result<Followed, OmnixError> {
        let windows = self.windows();
        let steps = 3 * windows.len();
        let mut done = 0;
        let mut step = || {
            done += 1;
            each(done - 1, steps)
        };
        let mut followed = Followed::default();
        // The points of window k are those from firsts[k] to firsts[k + 1].
        let mut firsts = Vec::with_capacity(windows.len() + 1);
        for k in windows.clone() {
            step()?;
            firsts.push(followed.source.len());
            self.choose(k, budget, seed, &mut *open(k)?, &mut followed)?;
        }
        firsts.push(followed.source.len());
        let native = |k: usize| firsts[k - windows.start]..firsts[k - windows.start + 1];
        let mut walk = Walk::new(self.images(), followed.source.clone(), followed.pixel.clone());
        self.walk(&mut walk, windows.clone(), &native, open, &mut step)?;
        followed.positions = walk.positions;
        Ok(followed)
    }

    /// Where pixels of an image of the part are at some times (images of the film), `[times][pixels][3]`: NaN where a point is lost, and
    /// outside the part. Only windows between the image and these times are opened. What it takes in memory is bounded, however many pixels
    /// and windows there are. `each` is called before every step.
    ///
    /// # Errors
    /// Failures of `open` and of the fields it opens, or of `each`.
    pub fn pixels(
        &self,
        (image, pixels): (usize, &[[u32; 2]]),
        times: &[usize],
        open: OpenField<'_>,
        each: &mut dyn FnMut() -> Result<(), OmnixError>,
    ) -> Result<Vec<f32>, OmnixError> {
        let mut positions = vec![f32::NAN; 3 * times.len() * pixels.len()];
        let inside = times.iter().copied().filter(|time| self.images().contains(time));
        let (Some(own), Some(least), Some(most)) = (self.window_of(image), inside.clone().min(), inside.max()) else {
            return Ok(positions);
        };
        // The next window has a say in what is shared with it.
        let mut windows = own..own + 1;
        while windows.end < self.windows().end && self.layout.shared(windows.end - 1).start <= most {
            windows.end += 1;
        }
        while windows.start > self.windows().start && self.layout.shared(windows.start - 1).end > least {
            windows.start -= 1;
        }
        let span = self.times(windows.start).start..self.times(windows.end - 1).end;
        let at_once = (AT_ONCE / (12 * span.len())).max(1);
        for (chunk, some) in pixels.chunks(at_once).enumerate() {
            let mut walk = Walk::new(span.clone(), vec![image; some.len()], some.to_vec());
            self.walk(&mut walk, windows.clone(), &|k| 0..if k == own { some.len() } else { 0 }, open, each)?;
            for (row, time) in times.iter().enumerate().filter(|(_, time)| span.contains(time)) {
                let first = 3 * (row * pixels.len() + chunk * at_once);
                let from = 3 * (time - span.start) * some.len();
                positions[first..first + 3 * some.len()].copy_from_slice(&walk.positions[from..][..3 * some.len()]);
            }
        }
        Ok(positions)
    }

    /// Follows the points of a walk from their windows, `native`, forth and back through `windows`.
    fn walk(
        &self,
        walk: &mut Walk,
        windows: Range<usize>,
        native: &dyn Fn(usize) -> Range<usize>,
        open: OpenField<'_>,
        step: &mut dyn FnMut() -> Result<(), OmnixError>,
    ) -> Result<(), OmnixError> {
        let mut active: Vec<usize> = Vec::new();
        for k in windows.clone() {
            step()?;
            if active.is_empty() && native(k).is_empty() {
                continue;
            }
            let mut field = open(k)?;
            let seam = k.checked_sub(1).filter(|before| windows.contains(before));
            let mut entries = match seam {
                Some(before) => self.carry(&active, before, k, &mut *field, walk)?,
                None => Vec::new(),
            };
            entries.extend(native(k).map(|point| Entry {
                point,
                image: walk.source[point],
                pixel: walk.pixel[point],
                offset: [0.0; 3],
            }));
            active = entries.iter().map(|entry| entry.point).collect();
            self.evaluate(k, seam, entries, &mut *field, walk)?;
        }
        active.clear();
        for k in windows.clone().rev() {
            step()?;
            if k + 1 < windows.end && !active.is_empty() {
                let mut field = open(k)?;
                let entries = self.carry(&active, k, k, &mut *field, walk)?;
                active = entries.iter().map(|entry| entry.point).collect();
                self.evaluate(k, Some(k), entries, &mut *field, walk)?;
            }
            active.extend(native(k));
            active.sort_unstable();
        }
        Ok(())
    }

    fn windows(&self) -> Range<usize> {
        let of = |k: &usize| self.chain.placements()[*k].part == self.part;
        let mut all = (0..self.chain.placements().len()).filter(of);
        let first = all.next().unwrap_or(0);
        first..all.next_back().unwrap_or(first) + 1
    }

    fn images(&self) -> Range<usize> {
        self.chain.parts()[self.part].clone()
    }

    fn first_image(&self, k: usize) -> usize {
        self.layout.windows()[k].images.start
    }

    /// The images that a window takes the points of: all of the part's are in one.
    fn own(&self, k: usize) -> Range<usize> {
        let border = |k: usize| {
            let shared = self.layout.shared(k);
            shared.start + shared.len().div_ceil(2)
        };
        let (windows, images) = (self.windows(), self.images());
        let start = if k == windows.start { images.start } else { border(k - 1) };
        start..if k + 1 == windows.end { images.end } else { border(k) }
    }

    /// The window of the part that an image's points are of.
    pub(super) fn window_of(&self, image: usize) -> Option<usize> {
        self.windows().find(|k| self.own(*k).contains(&image))
    }

    /// The times at which a window's paths count.
    fn times(&self, k: usize) -> Range<usize> {
        let (window, images) = (&self.layout.windows()[k].images, self.images());
        let start = if k == self.windows().start { window.start } else { self.layout.shared(k - 1).start };
        start.max(images.start)..window.end.min(images.end)
    }

    fn choose(
        &self,
        k: usize,
        budget: usize,
        seed: u64,
        field: &mut dyn WindowField,
        followed: &mut Followed,
    ) -> Result<(), OmnixError> {
        let (own, begin, width) = (self.own(k), self.first_image(k), self.size[1]);
        // A pixel that a mask leaves out has no confidence, and no score here: such are never chosen.
        let mut scored = |image: usize| {
            let (mut theta, confidence) = (field.theta(image - begin)?, field.confidence(image - begin)?);
            theta.iter_mut().zip(confidence).filter(|(_, c)| *c == 0.0).for_each(|(theta, _)| *theta = f32::NAN);
            Ok::<_, OmnixError>(theta)
        };
        let scores = own.clone().map(&mut scored).collect::<Result<Vec<_>, _>>()?;
        let slices: Vec<&[f32]> = scores.iter().map(Vec::as_slice).collect();
        let share = budget * own.len() / self.images().len();
        let threshold = scores.iter().flatten().copied().filter(|theta| !field.moves(*theta)).fold(0.0, f32::max);
        let chosen = choose_points(&slices, width, &PointOptions::new(share).seed(seed).threshold(threshold));
        for ((image, pixels), theta) in own.zip(&chosen).zip(&scores).filter(|((_, pixels), _)| !pixels.is_empty()) {
            let confidence = field.confidence(image - begin)?;
            for &p in pixels {
                followed.source.push(image);
                followed.pixel.push([(p % width) as u32, (p / width) as u32]);
                followed.theta.push(theta[p].clamp(0.0, 1.0));
                followed.confidence.push(confidence[p]);
                followed.moving.push(field.moves(theta[p]));
            }
        }
        Ok(())
    }

    /// Where window `into` takes up points that the other window of the seam behind window `seam` has followed. Those it does not see are lost.
    fn carry(
        &self,
        active: &[usize],
        seam: usize,
        into: usize,
        field: &mut dyn WindowField,
        walk: &Walk,
    ) -> Result<Vec<Entry>, OmnixError> {
        let to_part = self.chain.placements()[into].to_part;
        let from_part = to_part.inverse();
        let mut best: Vec<Option<(f32, Entry)>> = vec![None; active.len()];
        for image in self.layout.shared(seam) {
            let place = image - self.first_image(into);
            let view = View { surface: field.points(place)?, camera: field.camera(place), size: self.size };
            for (best, &point) in best.iter_mut().zip(active) {
                let position = walk.position(image, point);
                let Some((off, pixel)) = view.nearest(from_part.apply(position)) else { continue };
                if best.is_none_or(|(least, _)| off < least) {
                    let found = to_part.apply(view.point(pixel));
                    let offset = std::array::from_fn(|i| position[i] - found[i]);
                    *best = Some((off, Entry { point, image, pixel, offset }));
                }
            }
        }
        Ok(best.into_iter().flatten().map(|(_, entry)| entry).collect())
    }

    /// Adds the paths of window `k` that begin at `entries`; over `seam`'s shared images they go over from those that are there.
    fn evaluate(
        &self,
        k: usize,
        seam: Option<usize>,
        mut entries: Vec<Entry>,
        field: &mut dyn WindowField,
        walk: &mut Walk,
    ) -> Result<(), OmnixError> {
        let (begin, to_part) = (self.first_image(k), self.chain.placements()[k].to_part);
        let shared = seam.map_or(0..0, |seam| self.layout.shared(seam));
        // Of the window that is evaluated, at a shared image.
        let weight = |image: usize| {
            let later = (image - shared.start + 1) as f32 / (shared.len() + 1) as f32;
            if seam == Some(k) { 1.0 - later } else { later }
        };
        entries.sort_by_key(|entry| (entry.image, entry.point));
        for group in entries.chunk_by(|a, b| a.image == b.image) {
            let pixels: Vec<[u32; 2]> = group.iter().map(|entry| entry.pixel).collect();
            let paths = field.paths(group[0].image - begin, &pixels)?;
            for time in self.times(k) {
                let row = &paths[3 * (time - begin) * group.len()..][..3 * group.len()];
                for (entry, position) in group.iter().zip(row.as_chunks::<3>().0) {
                    let moved = to_part.apply(*position);
                    let at = walk.at(time, entry.point);
                    let to = &mut walk.positions[at..at + 3];
                    for axis in 0..3 {
                        let new = moved[axis] + entry.offset[axis];
                        to[axis] = if to[axis].is_finite() && shared.contains(&time) {
                            to[axis] + (new - to[axis]) * weight(time)
                        } else {
                            new
                        };
                    }
                }
            }
        }
        Ok(())
    }
}

/// Points on their way through windows.
struct Walk {
    /// The film's images whose times are kept.
    span: Range<usize>,
    source: Vec<usize>,
    pixel: Vec<[u32; 2]>,
    /// `[images of the span][points][3]`.
    positions: Vec<f32>,
}

impl Walk {
    fn new(span: Range<usize>, source: Vec<usize>, pixel: Vec<[u32; 2]>) -> Self {
        let positions = vec![f32::NAN; 3 * span.len() * source.len()];
        Self { span, source, pixel, positions }
    }

    /// Where the position of a point at an image's time begins.
    fn at(&self, image: usize, point: usize) -> usize {
        3 * ((image - self.span.start) * self.source.len() + point)
    }

    fn position(&self, image: usize, point: usize) -> [f32; 3] {
        let at = self.at(image, point);
        [self.positions[at], self.positions[at + 1], self.positions[at + 2]]
    }
}

#[cfg(test)]
mod tests {
    use omnix_geometry::{PixelCentre, Similarity, project};

    use super::*;
    use crate::windows::stored::{made, store, window_path};

    const SIZE: [usize; 2] = [24, 32];
    const FOCAL: f32 = 30.0;
    const IMAGES: usize = 26;

    /// Camera of an image in the film's world: it looks along z and goes along x.
    fn camera(image: usize) -> Camera {
        let intrinsics = [[FOCAL, 0.0, 16.0], [0.0, FOCAL, 12.0], [0.0, 0.0, 1.0]];
        let extrinsics = [[1.0, 0.0, 0.0, -0.15 * image as f32], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        Camera { extrinsics, intrinsics }
    }

    /// A wall; its upper half draws back with time.
    fn distance(row: usize, image: usize) -> f32 {
        if row < 12 { 6.0 + 0.05 * image as f32 } else { 6.0 }
    }

    /// Where the point that a pixel of an image shows is at the time of another image.
    fn truth(image: usize, [x, y]: [u32; 2], time: usize) -> [f32; 3] {
        let z = distance(y as usize, image);
        let [u, v] = [(x as f32 - 16.0) / FOCAL, (y as f32 - 12.0) / FOCAL];
        [u * z + 0.15 * image as f32, v * z, distance(y as usize, time)]
    }

    /// Window `k`'s own world, from the film's.
    fn world(k: usize) -> Similarity {
        let scale = [1.0, 0.5, 3.0, 1.7][k % 4];
        if k == 0 {
            Similarity::IDENTITY
        } else {
            Similarity { scale, translation: [k as f64, -1.0, 2.0], ..Similarity::IDENTITY }
        }
    }

    struct Fake {
        k: usize,
        first: usize,
        images: usize,
    }

    impl WindowField for Fake {
        fn theta(&mut self, _: usize) -> Result<Vec<f32>, OmnixError> {
            Ok((0..SIZE[0] * SIZE[1]).map(|p| if p / SIZE[1] < 12 { 0.9 } else { 0.1 }).collect())
        }

        fn confidence(&mut self, _: usize) -> Result<Vec<f32>, OmnixError> {
            Ok(vec![2.0; SIZE[0] * SIZE[1]])
        }

        fn moves(&self, theta: f32) -> bool {
            theta > 0.5
        }

        fn points(&mut self, image: usize) -> Result<Vec<f32>, OmnixError> {
            let pixels = (0..SIZE[0] as u32).flat_map(|y| (0..SIZE[1] as u32).map(move |x| [x, y]));
            let at = self.first + image;
            Ok(pixels.flat_map(|pixel| world(self.k).apply(truth(at, pixel, at))).collect())
        }

        fn paths(&mut self, image: usize, pixels: &[[u32; 2]]) -> Result<Vec<f32>, OmnixError> {
            let (at, world) = (self.first + image, world(self.k));
            let mut paths = Vec::new();
            for time in self.first..self.first + self.images {
                paths.extend(pixels.iter().flat_map(|pixel| world.apply(truth(at, *pixel, time))));
            }
            Ok(paths)
        }

        fn camera(&self, image: usize) -> Camera {
            let camera = camera(self.first + image);
            Camera { extrinsics: world(self.k).apply_to_w2c(&camera.extrinsics), ..camera }
        }
    }

    fn followed(cuts: &[usize], part: usize) -> (Layout, Chain, Followed) {
        let dir = tempfile::tempdir().unwrap();
        let layout = Layout::new(IMAGES, 8, 3, cuts).unwrap();
        for (k, window) in layout.windows().iter().enumerate() {
            let image = |image: usize| {
                let own = camera(image);
                let extrinsics = world(k).apply_to_w2c(&own.extrinsics);
                let depth = |p: usize| distance(p / SIZE[1], image) * world(k).scale as f32;
                made(SIZE[0] * SIZE[1], depth, None, Camera { extrinsics, ..own })
            };
            let images: Vec<_> = window.images.clone().map(image).collect();
            store(&window_path(dir.path(), k), "key", SIZE, &images).unwrap();
        }
        let chain = Chain::new(&layout, dir.path(), SIZE, None, &mut |_| Ok(())).unwrap();
        let follow = Follow { layout: &layout, chain: &chain, size: SIZE, part };
        let mut open = |k: usize| {
            let images = &layout.windows()[k].images;
            let fake: Box<dyn WindowField> = Box::new(Fake { k, first: images.start, images: images.len() });
            Ok(fake)
        };
        let found = follow.points(400, 42, &mut open, &mut |_, _| Ok(())).unwrap();
        (layout, chain, found)
    }

    #[test]
    fn points_are_followed_through_the_film_and_lost_when_they_leave() {
        let (layout, chain, found) = followed(&[], 0);
        assert_eq!(chain.parts().len(), 1);
        assert!(found.source.len() > 300 && found.source.is_sorted(), "{}", found.source.len());
        let (mut through, mut lost) = (0, 0);
        for point in 0..found.source.len() {
            let (source, pixel) = (found.source[point], found.pixel[point]);
            let seen = |time: usize| {
                let [u, v, _] = project(truth(source, pixel, time), &camera(time), PixelCentre::Whole);
                (0.0..31.0).contains(&u) && (0.0..23.0).contains(&v)
            };
            let mut times = 0;
            for time in 0..IMAGES {
                let at = 3 * (time * found.source.len() + point);
                let position = [0, 1, 2].map(|axis| found.positions[at + axis]);
                if position[0].is_nan() {
                    // It was out of the picture in every shared image of some seam on the way.
                    let way = source.min(time)..source.max(time) + 1;
                    let seams = (0..layout.windows().len() - 1).map(|k| layout.shared(k));
                    let gone = seams.filter(|s| s.start < way.end && s.end > way.start).any(|s| !s.clone().all(seen));
                    assert!(gone, "point {point} of image {source} at {time}");
                    continue;
                }
                times += 1;
                let truth = truth(source, pixel, time);
                let off = (0..3).map(|i| (position[i] - truth[i]).abs()).fold(0.0, f32::max);
                assert!(off < 0.02, "point {point} of image {source} at {time}: {position:?} {truth:?}");
            }
            assert!(times >= 5, "a point is followed in its own window at least");
            through += usize::from(times > 8);
            lost += usize::from(times < IMAGES);
        }
        assert!(through > 100 && lost > 100, "{through} over a seam, {lost} lost");
    }

    #[test]
    fn pixels_go_where_chosen_points_go_whatever_is_asked_of_them() {
        let (layout, chain, found) = followed(&[13], 1);
        let follow = Follow { layout: &layout, chain: &chain, size: SIZE, part: 1 };
        let opened = std::cell::RefCell::new(Vec::new());
        let ask = |image: usize, pixels: &[[u32; 2]], times: &[usize]| {
            let mut open = |k: usize| {
                opened.borrow_mut().push(k);
                let images = &layout.windows()[k].images;
                let fake: Box<dyn WindowField> = Box::new(Fake { k, first: images.start, images: images.len() });
                Ok(fake)
            };
            follow.pixels((image, pixels), times, &mut open, &mut || Ok(())).unwrap()
        };
        let bits = |positions: &[f32]| positions.iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
        let all: Vec<usize> = (0..IMAGES).collect();
        let count = found.source.len();
        for point in (0..count).step_by(7) {
            let (image, pixel) = (found.source[point], found.pixel[point]);
            let path = ask(image, &[pixel], &all);
            assert!(path[..3 * 13].iter().all(|v| v.is_nan()), "another part");
            for time in 13..IMAGES {
                let chosen = &found.positions[3 * ((time - 13) * count + point)..][..3];
                assert_eq!(bits(&path[3 * time..][..3]), bits(chosen), "point {point} at {time}");
                assert_eq!(bits(&ask(image, &[pixel], &[time])), bits(chosen), "point {point} at {time} alone");
            }
        }
        // Times of its own window open no other.
        let own = layout.windows().iter().position(|window| window.images.start == 13).unwrap();
        opened.borrow_mut().clear();
        assert!(ask(13, &[[3, 4]], &[13, 14]).iter().all(|v| v.is_finite()));
        assert_eq!(*opened.borrow(), [own]);
        assert!(ask(13, &[], &all).is_empty() && ask(13, &[[3, 4]], &[]).is_empty());
    }

    #[test]
    fn nothing_is_followed_into_another_part() {
        let (_, chain, found) = followed(&[13], 1);
        assert_eq!(chain.parts(), [0..13, 13..26]);
        assert!(found.source.iter().all(|source| (13..26).contains(source)));
        assert_eq!(found.positions.len(), 3 * 13 * found.source.len());
    }
}
