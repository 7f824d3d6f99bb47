//! DROID: a robot's arm filmed by cameras that stand and one at its wrist, all at the same time; points on the fingers of its gripper are
//! tracked.
//!
//! DROID itself is published as stereo recordings of the cameras' maker. What is read is one episode as it is prepared from them for
//! training, with the depth that the maker's software finds:
//! `recordings/SERIAL/` with `rgb/NNNNNN.png`, `depth/NNNNNN.png` (16 bits, millimetres; 0 and 65535: unknown) and `intrinsics.json`
//! {fx, fy, cx, cy, width, height}; `extrinsics.npz`, camera to world in the frame of the robot's base, {external_SERIAL 4 x 4 of each
//! standing camera, wrist_extrinsics `[T, 4, 4]` of the other one}; and, where it was made, `tracks.npz` {tracks_3d `[T, N, 3]` in the same
//! world, tracks_2d_SERIAL `[T, N, 2]`}. NNNNNN is the moment, and the place in `[T]`. A point is visible in an image where the depth there
//! agrees with its own within 0.03. What moves is not said. Unit: metres.

use std::path::{Path, PathBuf};

use glam::DVec3;
use omnix_tensors::read_text;
use serde::Deserialize;

use crate::files::{Archive, expect_folder, folders};
use crate::posed::{Stream, deep_depth, intrinsics_of, point, rows, shows};
use crate::rigid::{Pinhole, Rigid};
use crate::scene::{Pick, Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Flag, Motion, Tracks, Unit};

pub(super) const SIGNATURE: &[&str] = &["recordings", "extrinsics.npz"];
/// Difference of depth within which a point is seen, in metres.
const AGREES: f64 = 0.03;
/// A file with six numbers is no longer than this.
const LONGEST: u64 = 1 << 16;

/// What a camera's `intrinsics.json` says.
#[derive(Debug, Deserialize)]
struct Intrinsics {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: usize,
    height: usize,
}

/// A camera of an episode.
#[derive(Debug)]
struct Station {
    stream: Stream,
    size: [usize; 2],
    /// Of its pose at the first of `poses`; each image has its own.
    lens: Pinhole,
    /// World to camera: one for all moments, or one for each.
    poses: Vec<Rigid>,
}

#[derive(Debug)]
struct Droid {
    folder: PathBuf,
    stations: Vec<Station>,
    videos: Vec<Video>,
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let recordings = folder.join("recordings");
    let mut extrinsics = Archive::open(&folder.join("extrinsics.npz"))?;
    let mut stations = Vec::new();
    for camera in folders(&recordings)? {
        let serial = camera.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // The recordings themselves may lie beside what was made of them.
        if ["SVO", "MP4"].contains(&serial.as_str()) {
            continue;
        }
        let pictures = expect_folder(camera.join("rgb"))?;
        let stream = Stream::new(&serial, pictures, camera.clone())?;
        let external = format!("external_{serial}");
        let poses = if extrinsics.has(&external) {
            extrinsics.array(&external)?.expect(&[4, 4])?
        } else {
            extrinsics.any(&["wrist_extrinsics", &external])?.expect(&[0, 4, 4])?
        };
        let values = poses.to_f64();
        if !values.iter().all(|v| v.is_finite()) {
            return Err(poses.wrong("has a NaN or infinite number"));
        }
        let (size, lens) = lens(&camera.join("intrinsics.json"))?;
        let poses = values.chunks_exact(16).map(|pose| Rigid::from_rows(rows(pose)).inverse()).collect();
        stations.push(Station { stream, size, lens, poses });
    }
    if stations.is_empty() {
        return Err(DataError::NoPictures { path: recordings });
    }
    let videos = stations.iter().map(|station| station.stream.video()).collect();
    Ok(Box::new(Droid { folder: folder.to_owned(), stations, videos }))
}

/// The size of a camera's pictures, and its lens.
fn lens(path: &Path) -> Result<([usize; 2], Pinhole), DataError> {
    if !path.exists() {
        return Err(DataError::Missing { path: path.to_owned() });
    }
    let refuse = |reason: String| DataError::Json { reason, path: path.to_owned() };
    let Intrinsics { fx, fy, cx, cy, width, height } =
        serde_json::from_str(&read_text(path, LONGEST)?).map_err(|error| refuse(error.to_string()))?;
    if ![fx, fy, cx, cy].iter().all(|v| v.is_finite()) {
        return Err(refuse("a number is NaN or infinite".to_owned()));
    }
    let identity = Rigid { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO };
    let lens = intrinsics_of(&[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], identity);
    Ok(([width, height], lens.map_err(|_| refuse("fx and fy are not above 0".to_owned()))?))
}

impl Scene for Droid {
    fn set(&self) -> Set {
        Set::Droid
    }

    fn path(&self) -> &Path {
        &self.folder
    }

    fn videos(&self) -> &[Video] {
        &self.videos
    }

    fn unit(&self) -> Unit {
        Unit::Metre
    }

    fn view(&self, video: usize, frame: usize) -> Result<View, DataError> {
        let station = &self.stations[video];
        let image = station.stream.picture(frame)?;
        let moment = station.stream.number(frame);
        let pose = if station.poses.len() == 1 { station.poses.first() } else { station.poses.get(moment as usize) };
        let w2c = *pose.ok_or_else(|| DataError::Array {
            array: "wrist_extrinsics".to_owned(),
            reason: format!("has {} poses and none for the moment {moment}", station.poses.len()),
            path: self.folder.join("extrinsics.npz"),
        })?;
        let mut view =
            View { image, camera: Pinhole { w2c, ..station.lens }, depth: None, moving: None, moment, seconds: None };
        if view.size() != station.size {
            let path = station.stream.pictures[frame].clone();
            return Err(DataError::Sizes { expected: station.size, found: view.size(), path });
        }
        let folder = self.folder.join("recordings").join(&station.stream.name).join("depth");
        let metres = |level: u16| if level == u16::MAX { f32::NAN } else { f32::from(level) / 1000.0 };
        view.depth = Some(deep_depth(&station.stream.beside(frame, &folder, "png"), view.size(), metres)?);
        Ok(view)
    }

    fn motion(&self, picks: &[Pick], views: &[View]) -> Result<Motion, DataError> {
        let path = self.folder.join("tracks.npz");
        if !path.exists() {
            return Ok(Motion::Unknown);
        }
        let mut archive = Archive::open(&path)?;
        let all = archive.array("tracks_3d")?.expect(&[0, 0, 3])?;
        let (moments, count) = (all.shape()[0], all.shape()[1]);
        let positions = all.to_f64();
        let mut tracks = Tracks { count, pixels: Some(Vec::new()), ..Tracks::default() };
        for (pick, view) in picks.iter().zip(views) {
            let station = &self.stations[pick.video];
            let moment = view.moment as usize;
            if moment >= moments {
                return Err(all.wrong(format!("has {moments} moments and none of the number {moment}")));
            }
            let here = moment * count..(moment + 1) * count;
            for values in positions[3 * here.start..3 * here.end].chunks_exact(3) {
                let position = point(values, DVec3::ZERO);
                let unknown = position[0].is_nan();
                tracks.positions.push(position);
                let seen = || shows(view, DVec3::from_slice(values), AGREES);
                tracks.visible.push(if unknown { Flag::Unknown } else { seen() });
            }
            // Positions in the picture are of the picture as it lies on the disk: no longer true once it is fitted.
            let own = format!("tracks_2d_{}", station.stream.name);
            let as_on_disk = view.size() == station.size
                && (view.camera.focal, view.camera.principal) == (station.lens.focal, station.lens.principal);
            if !as_on_disk || !archive.has(&own) {
                tracks.pixels = None;
            } else if let Some(pixels) = &mut tracks.pixels {
                let stated = archive.array(&own)?.expect(&[moments, count, 2])?.to_f32();
                pixels.extend(&stated.as_chunks::<2>().0[here]);
            }
        }
        Ok(Motion::Tracks(tracks))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use crate::read::{ReadOptions, read};
    use crate::sets::tests_support::{agrees, floats, picks, tracks};

    const SIZE: [u32; 2] = [28, 14];
    const MOMENTS: u32 = 3;

    /// An episode of a standing camera and one at the wrist, with the truth of both videos, and tracks through pixels of the first image.
    fn write(dir: &Path) -> (crate::Sample, Tracks) {
        let views = (0..2).flat_map(|video| (0..MOMENTS).map(move |moment| (video, moment)));
        let views: Vec<_> = views
            .map(|(video, moment)| {
                (made::time(video, moment), made::path(SIZE, video, if video == 0 { 1 } else { moment }))
            })
            .collect();
        let truth = made::sample(SIZE, &views);
        let mut wrist = Vec::new();
        let mut standing = [0.0; 16];
        for (image, (time, _)) in views.iter().enumerate() {
            let serial = ["17225336", "24400334"][time.video as usize];
            let file = |kind: &str| dir.join(format!("recordings/{serial}/{kind}/{:06}.png", time.frame));
            made::picture(&file("rgb"), &truth, image);
            let mut levels: Vec<u16> =
                truth.depth(image).unwrap().iter().map(|z| (z * 1000.0).round() as u16).collect();
            (levels[3], levels[4]) = (0, u16::MAX);
            made::deep(&file("depth"), SIZE, levels);
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            let text = format!(
                "{{\"fx\": {}, \"fy\": {}, \"cx\": {}, \"cy\": {}, \"width\": 28, \"height\": 14, \"serial\": {serial}}}",
                k[0], k[4], k[2], k[5]
            );
            made::text(&dir.join(format!("recordings/{serial}/intrinsics.json")), &text);
            if time.video == 0 { standing = pose } else { wrist.extend(pose) }
        }
        made::npz(
            &dir.join("extrinsics.npz"),
            &[("external_17225336", &[4, 4], &standing), ("wrist_extrinsics", &[MOMENTS.into(), 4, 4], &wrist)],
        );
        let chosen: Vec<usize> = (0..truth.pixels()).step_by(5).collect();
        let all = tracks(&truth, &chosen);
        let (n, half) = (chosen.len() as u64, all.positions.len() / 2);
        let pixels = all.pixels.as_ref().unwrap();
        made::npz(
            &dir.join("tracks.npz"),
            &[
                ("tracks_3d", &[MOMENTS.into(), n, 3], &floats(&all.positions[..half])),
                ("tracks_2d_17225336", &[MOMENTS.into(), n, 2], &floats(&pixels[..half])),
                ("tracks_2d_24400334", &[MOMENTS.into(), n, 2], &floats(&pixels[half..])),
            ],
        );
        (truth, all)
    }

    #[test]
    fn a_written_episode_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let (truth, all) = write(dir.path());
        std::fs::create_dir(dir.path().join("recordings/SVO")).unwrap();
        let opened = crate::sets::open(dir.path(), None).unwrap();
        let frames: Vec<usize> = opened.videos().iter().map(|video| video.frames).collect();
        assert_eq!((opened.set(), frames), (Set::Droid, vec![3, 3]));
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default()).unwrap();
        agrees(&sample, &truth, usize::MAX);
        let depths = sample.depth(4).unwrap().iter().zip(truth.depth(4).unwrap());
        assert!(depths.clone().all(|(a, b)| a.is_nan() || (a - b).abs() <= 0.000_51));
        assert_eq!(depths.filter(|(a, _)| a.is_nan()).count(), 2);
        assert_eq!(sample.times().iter().map(|t| t.moment).collect::<Vec<_>>(), [0, 1, 2, 0, 1, 2]);
        let Motion::Tracks(found) = sample.motion() else { panic!("no tracks") };
        assert_eq!((&found.positions, &found.pixels), (&all.positions, &all.pixels));
        // Depth of whole pixels says of most points what the truth says.
        let same = found.visible.iter().zip(&all.visible).filter(|(a, b)| a == b).count();
        assert!(10 * same > 8 * all.visible.len(), "{same} of {}", all.visible.len());
        // Tracks fall where the files say so. (Without masks the plate that moves looks like depth that disagrees.)
        let report = crate::check::check(&sample, dir.path());
        let tracks = report.tracks.unwrap();
        assert!(tracks.compared > 100 && tracks.most < 1e-3, "{tracks:?}");
        assert!(report.problems.iter().all(|p| ["warp", "visibility"].contains(&p.kind)), "{:?}", report.problems);
    }

    #[test]
    fn what_is_missing_is_named() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path());
        let read_all = || {
            let opened = crate::sets::open(dir.path(), None)?;
            read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default())
        };
        // Without tracks, nothing is known about motion.
        std::fs::remove_file(dir.path().join("tracks.npz")).unwrap();
        assert!(matches!(read_all().unwrap().motion(), Motion::Unknown));
        made::npz(&dir.path().join("tracks.npz"), &[("tracks_3d", &[2, 1, 3], &[0.0; 6])]);
        assert!(read_all().unwrap_err().to_string().contains("none of the number 2"));
        let intrinsics = dir.path().join("recordings/24400334/intrinsics.json");
        made::text(&intrinsics, "{\"fx\": 30, \"fy\": 30, \"cx\": 14, \"cy\": 7, \"width\": 56, \"height\": 28}");
        assert!(read_all().unwrap_err().to_string().contains("28 x 14 pixels where 56 x 28"));
        made::text(&intrinsics, "{\"fx\": 30}");
        assert!(read_all().unwrap_err().to_string().contains("missing field `fy`"));
        made::npz(&dir.path().join("extrinsics.npz"), &[("external_17225336", &[4, 4], &[0.0; 16])]);
        let error = read_all().unwrap_err().to_string();
        assert!(error.contains("wrist_extrinsics") && error.contains("external_17225336"), "{error}");
        std::fs::remove_dir_all(dir.path().join("recordings/17225336/rgb")).unwrap();
        assert!(matches!(read_all(), Err(DataError::Missing { .. })));
    }
}
