//! The paper's own set, drawn by a game engine: synchronised cameras around moving meshes.
//!
//! `image/CAMERA/frame_NNNN.jpg`, `camera/CAMERA/frame_NNNN.npz` {intrinsic 3 x 3, camera_pose 4 x 4 camera to world}, `depth/CAMERA/frame_NNNN.npy`
//! (z-depth, `[H, W]`; 0 and 65504 are unknown), `foreground_mask/CAMERA/frame_NNNN.png`, and for the meshes, in the world of the poses,
//! `vertex/frame_NNNN.npz` {ACTOR: `[V, 3]`} and `face.npz` {ACTOR: `[F, 3]`}. NNNN is the moment. Foreground points follow the mesh
//! (`mesh.rs`), background points stand still. Unit: that of the files, taken as one of the scene's own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;

use super::mesh::{Faces, Posed};
use crate::dense::standing;
use crate::files::{Archive, folders};
use crate::posed::{Stream, moving, npy_depth};
use crate::rigid::centre;
use crate::scene::{Pick, Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Dense, Flag, Motion, Unit};

pub(super) const SIGNATURE: &[&str] = &["image", "vertex", "face.npz"];
/// The largest f16: nothing was hit.
const FAR: f32 = 65504.0;

#[derive(Debug)]
struct Ue {
    folder: PathBuf,
    streams: Vec<Stream>,
    videos: Vec<Video>,
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let mut streams = Vec::new();
    for camera in folders(&folder.join("image"))? {
        let name = camera.file_name().unwrap_or_default().to_string_lossy().into_owned();
        streams.push(Stream::new(&name, camera, folder.join("camera").join(&name))?);
    }
    if streams.is_empty() {
        return Err(DataError::NoPictures { path: folder.join("image") });
    }
    let videos = streams.iter().map(Stream::video).collect();
    Ok(Box::new(Ue { folder: folder.to_owned(), streams, videos }))
}

impl Ue {
    fn file(&self, video: usize, frame: usize, kind: &str, extension: &str) -> PathBuf {
        let stream = &self.streams[video];
        stream.beside(frame, &self.folder.join(kind).join(&stream.name), extension)
    }

    /// The faces of all actors, in the order of their names, and for each its number of vertices.
    fn faces(&self, first: &BTreeMap<String, Vec<DVec3>>) -> Result<Faces, DataError> {
        let path = self.folder.join("face.npz");
        let mut archive = Archive::open(&path)?;
        let (mut corners, mut offset) = (Vec::new(), 0);
        for (actor, vertices) in first {
            let array = archive.array(actor)?.expect(&[0, 3])?;
            for corner in array.to_f64().chunks_exact(3) {
                if !corner.iter().all(|c| *c >= 0.0 && *c < vertices.len() as f64) {
                    return Err(array.wrong(format!("names a vertex that the actor's {} do not have", vertices.len())));
                }
                corners.push([corner[0], corner[1], corner[2]].map(|c| c as u32 + offset));
            }
            offset += vertices.len() as u32;
        }
        Faces::new(corners, offset as usize).ok_or(DataError::NoArray {
            array: "faces".to_owned(),
            found: archive.names().join(", "),
            path,
        })
    }

    /// The vertices of all actors at the moment of an image.
    fn vertices(&self, pick: &Pick) -> Result<BTreeMap<String, Vec<DVec3>>, DataError> {
        let path = self.streams[pick.video].beside(pick.frame, &self.folder.join("vertex"), "npz");
        let mut archive = Archive::open(&path)?;
        let mut actors = BTreeMap::new();
        for name in archive.names() {
            let values = archive.array(&name)?.expect(&[0, 3])?.to_f64();
            actors.insert(name, values.chunks_exact(3).map(DVec3::from_slice).collect());
        }
        Ok(actors)
    }
}

impl Scene for Ue {
    fn set(&self) -> Set {
        Set::Ue
    }

    fn path(&self) -> &Path {
        &self.folder
    }

    fn videos(&self) -> &[Video] {
        &self.videos
    }

    fn unit(&self) -> Unit {
        Unit::Scene
    }

    fn view(&self, video: usize, frame: usize) -> Result<View, DataError> {
        let mut view = self.streams[video].view(frame, &["intrinsic"], &["camera_pose"])?;
        let mut depth = npy_depth(&self.file(video, frame, "depth", "npy"), view.size())?;
        depth.iter_mut().filter(|z| **z >= FAR).for_each(|z| *z = f32::NAN);
        view.depth = Some(depth);
        view.moving = Some(moving(&self.file(video, frame, "foreground_mask", "png"), view.size())?);
        view.moment = self.streams[video].number(frame);
        Ok(view)
    }

    fn motion(&self, picks: &[Pick], views: &[View]) -> Result<Motion, DataError> {
        let foreground =
            |image: usize, pixel: usize| views[image].moving.as_ref().is_some_and(|moving| moving[pixel] == Flag::Yes);
        let mut dense = standing(views, |image, pixel| !foreground(image, pixel));
        if picks.is_empty() {
            return Ok(Motion::Dense(dense));
        }
        let actors = picks.iter().map(|pick| self.vertices(pick)).collect::<Result<Vec<_>, _>>()?;
        for (pick, here) in picks.iter().zip(&actors) {
            let same = |a: &BTreeMap<String, Vec<DVec3>>| {
                a.iter().map(|(name, v)| (name.clone(), v.len())).collect::<Vec<_>>()
            };
            if same(here) != same(&actors[0]) {
                let path = self.streams[pick.video].beside(pick.frame, &self.folder.join("vertex"), "npz");
                let reason = "has other actors or numbers of vertices than the other moments".to_owned();
                return Err(DataError::Array { array: "vertex".to_owned(), reason, path });
            }
        }
        let faces = self.faces(&actors[0])?;
        let vertices: Vec<Vec<DVec3>> =
            actors.into_iter().map(|actors| actors.into_values().flatten().collect()).collect();
        for source in 0..views.len() {
            follow(&mut dense, source, views, &faces, &vertices, &foreground);
        }
        Ok(Motion::Dense(dense))
    }
}

/// Moves the foreground points of one source image with the mesh.
fn follow(
    dense: &mut Dense,
    source: usize,
    views: &[View],
    faces: &Faces,
    vertices: &[Vec<DVec3>],
    foreground: &(impl Fn(usize, usize) -> bool + Sync),
) {
    let view = &views[source];
    let (count, [width, height]) = (views.len(), view.size());
    let pixels = width * height;
    let posed = Posed::new(faces, &vertices[source]);
    let to_world = view.camera.w2c.inverse();
    let depth = view.depth.as_deref().unwrap_or_default();
    let known = |pixel: &usize| foreground(source, *pixel) && depth[*pixel].is_finite() && depth[*pixel] > 0.0;
    let chosen: Vec<usize> = (0..depth.len()).filter(known).collect();
    // In the order of the pixels, whatever thread is done first.
    let paths: Vec<Vec<Option<DVec3>>> = chosen
        .par_iter()
        .map(|pixel| {
            let [u, v] = centre(*pixel, width);
            let point = to_world.apply(view.camera.unproject(u, v, f64::from(depth[*pixel])));
            let Some(face) = posed.bind(point) else {
                return vec![None; count];
            };
            let at =
                |time: usize| if time == source { Some(point) } else { posed.follow(point, face, &vertices[time]) };
            (0..count).map(at).collect()
        })
        .collect();
    for (pixel, path) in chosen.iter().zip(paths) {
        for (time, position) in path.into_iter().enumerate() {
            let position = position.map_or([f32::NAN; 3], |p| p.as_vec3().to_array());
            dense.positions[(source * count + time) * pixels + pixel] = position;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use crate::read::{ReadOptions, read};
    use crate::sets::tests_support::{agrees, picks};

    fn write(dir: &Path) -> crate::Sample {
        let views: Vec<_> = [0, 1]
            .into_iter()
            .flat_map(|v| (0..3).map(move |f| (made::time(v, f), made::path([28, 14], v, f))))
            .collect();
        let truth = made::sample([28, 14], &views);
        for (image, time) in truth.times().iter().enumerate() {
            let file = |kind: &str, extension: &str| {
                dir.join(format!("{kind}/cam_{:02}/frame_{:04}.{extension}", time.video, time.frame))
            };
            made::picture(&file("image", "png"), &truth, image);
            let mut depth = truth.depth(image).unwrap().to_vec();
            (depth[0], depth[1]) = (0.0, 65504.0);
            made::npy(&file("depth", "npy"), &[14, 28], &depth);
            made::mask(
                &file("foreground_mask", "png"),
                [28, 14],
                truth.moving(image).unwrap().iter().map(|f| *f == Flag::Yes),
            );
            let (pose, k) = made::pose_and_intrinsics(&truth, image);
            made::npz(&file("camera", "npz"), &[("intrinsic", &[3, 3], &k), ("camera_pose", &[4, 4], &pose)]);
            let (corners, faces) = made::mesh(time.moment);
            let far: Vec<f64> = [90.0; 9].to_vec();
            made::npz(
                &dir.join(format!("vertex/frame_{:04}.npz", time.frame)),
                &[("a_still_thing", &[3, 3], &far), ("plate", &[4, 3], corners.as_flattened())],
            );
            let faces: Vec<f64> = faces.iter().flatten().map(|c| f64::from(*c)).collect();
            made::npz(
                &dir.join("face.npz"),
                &[("a_still_thing", &[1, 3], &[0.0, 1.0, 2.0]), ("plate", &[2, 3], &faces)],
            );
        }
        truth
    }

    #[test]
    fn a_written_scene_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let truth = write(dir.path());
        let opened = crate::sets::open(dir.path(), None).unwrap();
        assert_eq!((opened.set(), opened.videos().len()), (Set::Ue, 2));
        let sample = read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default()).unwrap();
        agrees(&sample, &truth, 2);
        assert_eq!(sample.moving(4), truth.moving(4));
        assert_eq!(sample.times()[5].moment, 2);
        for (source, time) in (0..6).flat_map(|s| (0..6).map(move |t| (s, t))) {
            let (found, exact) = (sample.positions(source, time).unwrap(), truth.positions(source, time).unwrap());
            for (pixel, (a, b)) in found.iter().zip(exact).enumerate().skip(2) {
                let off = (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
                assert!(off < 1e-4, "{source} {time} {pixel}: {a:?} instead of {b:?}");
            }
            assert!(found[..2].iter().all(|p| p[0].is_nan()));
        }
    }

    #[test]
    fn meshes_that_do_not_fit_are_named() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path());
        let read = || {
            let opened = crate::sets::open(dir.path(), None).unwrap();
            read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default()).unwrap_err().to_string()
        };
        made::npz(
            &dir.path().join("face.npz"),
            &[("plate", &[1, 3], &[0.0, 1.0, 7.0]), ("a_still_thing", &[0, 3], &[])],
        );
        assert!(read().contains("names a vertex"), "{}", read());
        made::npz(&dir.path().join("vertex/frame_0001.npz"), &[("plate", &[1, 3], &[0.0; 3])]);
        assert!(read().contains("other actors"), "{}", read());
        std::fs::remove_file(dir.path().join("vertex/frame_0001.npz")).unwrap();
        assert!(read().contains("not there") && read().contains("frame_0001.npz"), "{}", read());
    }
}
