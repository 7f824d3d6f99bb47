//! Scenes written, stopped, taken up again and read back.

use super::*;

fn job(out: &Path) -> Job {
    Job {
        recipe: Recipe { frames: 3, ..Recipe::default() },
        assets: Assets::default(),
        seed: 9,
        scenes: 3,
        cameras: 2,
        size: [28, 16],
        layout: Layout::Ue,
        labels: Labels::default(),
        shard: [0, 1],
        out: out.to_owned(),
    }
}

/// Every file below a folder and its digest.
fn tree(folder: &Path) -> BTreeMap<PathBuf, blake3::Hash> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(
                tree(&path).into_iter().map(|(name, hash)| (Path::new(path.file_name().unwrap()).join(name), hash)),
            );
        } else {
            all.insert(path.file_name().unwrap().into(), blake3::hash(&fs::read(&path).unwrap()));
        }
    }
    all
}

#[test]
fn stopped_sharded_and_repeated_runs_leave_the_same_files() {
    let folder = tempfile::tempdir().unwrap();
    let (once, parts) = (folder.path().join("once"), folder.path().join("parts"));
    job(&once).run(&|| false, |_| ()).unwrap();
    // One scene, then a partial folder as a killed run leaves it, then the rest by shards.
    let asked = std::cell::Cell::new(0);
    // Before the first scene, its three frames, before the second scene; then within it.
    let later = || asked.replace(asked.get() + 1) > 5;
    assert!(matches!(job(&parts).run(&later, |_| ()), Err(ScenesError::Stopped)));
    fs::create_dir(parts.join(".omnix-scene_000001.part")).unwrap();
    let mut kept = Vec::new();
    for shard in 0..2 {
        let part = Job { shard: [shard, 2], ..job(&parts) };
        part.run(&|| false, |done| kept.push((done.index, done.kept))).unwrap();
    }
    assert_eq!(kept, [(0, true), (2, false), (1, false)]);
    for scene in ["scene_000000", "scene_000001", "scene_000002"] {
        let (a, b) = (tree(&once.join(scene)), tree(&parts.join(scene)));
        // 4 files for each of 6 images, 3 of vertices, faces, scene.json.
        assert_eq!((a.len(), &a), (29, &b), "{scene}");
    }
    assert!(!parts.join(".omnix-scene_000001.part").exists());
    let other = Job { seed: 10, ..job(&once) }.run(&|| false, |_| ()).unwrap_err();
    assert!(matches!(other, ScenesError::OtherJob { .. }), "{other}");
}

#[test]
fn both_layouts_are_read_back_as_samples() {
    let folder = tempfile::tempdir().unwrap();
    for (layout, name) in [(Layout::Ue, "ue"), (Layout::Omnix, "omnix")] {
        let job = Job { layout, scenes: 1, size: [56, 42], ..job(&folder.path().join(name)) };
        let mut refused = BTreeMap::new();
        let (scene, states, rigs, _) = job.chosen(0, &mut refused).unwrap();
        job.run(&|| false, |_| ()).unwrap();
        let read = omnix_data::sets::open(&job.out.join("scene_000000"), None).unwrap();
        assert_eq!(read.videos().len(), 2, "{name}");
        let picks: Vec<_> = (0..2)
            .flat_map(|video| {
                (0..3).map(move |frame| omnix_data::Pick {
                    video,
                    frame,
                    as_video: video as u32,
                    as_frame: frame as u32,
                })
            })
            .collect();
        let sample = omnix_data::read(&*read, &picks, &omnix_data::ReadOptions::default()).unwrap();
        for (image, pick) in picks.iter().enumerate() {
            let view = rigs[pick.video].at(pick.frame as f64 * scene.frame_seconds(), job.size);
            let hits = hits(&view, &states[pick.frame]);
            let moving = moves(&hits, &states[pick.frame], &states);
            for pixel in 0..hits.len() {
                let (depth, flag) = (sample.depth(image).unwrap()[pixel], sample.moving(image).unwrap()[pixel]);
                match hits[pixel] {
                    Some(hit) => {
                        assert!((f64::from(depth) / hit.t - 1.0).abs() < 1e-6, "{name}: {depth} {}", hit.t)
                    }
                    None => assert!(depth.is_nan(), "{name}"),
                }
                assert_eq!(flag == omnix_data::Flag::Yes, moving[pixel], "{name}");
            }
            let pose = sample.cameras()[image].extrinsics;
            let own = view.extrinsics();
            let most = pose.iter().flatten().zip(own.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(most < 1e-5, "{name}: {most}");
        }
    }
}

#[test]
fn a_folder_in_use_and_jobs_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let good = job(folder.path());
    let lock = File::create(folder.path().join(".omnix-scenes-0-of-1.lock")).unwrap();
    lock.lock().unwrap();
    assert!(matches!(good.run(&|| false, |_| ()), Err(ScenesError::InUse { .. })));
    for (bad, field) in [
        (Job { size: [4, 16], ..good.clone() }, "size"),
        (Job { cameras: 0, ..good.clone() }, "cameras"),
        (Job { shard: [2, 2], ..good.clone() }, "shard"),
        (Job { scenes: 1_000_001, ..good.clone() }, "scenes"),
    ] {
        assert!(bad.run(&|| false, |_| ()).unwrap_err().to_string().contains(field), "{field}");
    }
    let nowhere = Job { out: folder.path().join("file/below"), ..good };
    fs::write(folder.path().join("file"), "").unwrap();
    assert!(matches!(nowhere.run(&|| false, |_| ()), Err(ScenesError::Write { .. })));
}

/// The numbers of an NPY file of f32.
fn numbers(path: &Path) -> Vec<f32> {
    let bytes = fs::read(path).unwrap();
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[start..].chunks_exact(4).map(|v| f32::from_le_bytes(v.try_into().unwrap())).collect()
}

#[test]
fn normals_and_flow_agree_with_depth_and_cameras() {
    use glam::{DVec2, DVec3};

    let folder = tempfile::tempdir().unwrap();
    let labels = Labels { normals: true, flow: true };
    for (layout, name) in [(Layout::Ue, "ue"), (Layout::Omnix, "omnix")] {
        let job = Job { layout, labels, scenes: 1, size: [56, 42], ..job(&folder.path().join(name)) };
        let (scene, states, rigs, _) = job.chosen(0, &mut BTreeMap::new()).unwrap();
        job.run(&|| false, |_| ()).unwrap();
        let out = job.out.join("scene_000000");
        assert!(omnix_data::sets::open(&out, None).is_ok(), "the layout is read with more beside it");
        let (width, seconds) = (56, |frame: usize| frame as f64 * scene.frame_seconds());
        let (mut flat, mut still, mut moving) = (0, 0, 0);
        for (camera, rig) in rigs.iter().enumerate() {
            for frame in 0..2 {
                let (view, next) = (rig.at(seconds(frame), job.size), rig.at(seconds(frame + 1), job.size));
                let hits = hits(&view, &states[frame]);
                let file = |kind: &str| out.join(format!("{kind}/cam_{camera:02}/frame_{frame:04}.npy"));
                let (normals, flow) = (numbers(&file("normals")), numbers(&file("flow")));
                assert_eq!((normals.len(), flow.len()), (3 * hits.len(), 2 * hits.len()));
                let point = |pixel: usize, hit: &Hit| {
                    let at = View::pixel(pixel % width, pixel / width);
                    let ray = view.ray(at);
                    view.rotation.inverse() * (ray.direction * hit.t)
                };
                for (pixel, hit) in hits.iter().enumerate() {
                    let normal = DVec3::from_array([0, 1, 2].map(|i| f64::from(normals[3 * pixel + i])));
                    let Some(hit) = hit else {
                        assert!(normal.is_nan() && flow[2 * pixel].is_nan());
                        continue;
                    };
                    let own = point(pixel, hit);
                    assert!((normal.length() - 1.0).abs() < 1e-6 && normal.dot(own) < 1e-6, "{normal} {own}");
                    // Two pixels on one flat triangle: what lies between them is at right angles to the normal.
                    if let Some(Some(right)) = hits.get(pixel + 1).filter(|_| pixel % width + 1 < width)
                        && (right.instance, right.triangle) == (hit.instance, hit.triangle)
                    {
                        let along = (point(pixel + 1, right) - own).normalize();
                        assert!(normal.dot(along).abs() < 1e-5, "{normal} {along}");
                        flat += 1;
                    }
                    // Where the point is in the next state, as its camera sees it.
                    let then = next.rotation.inverse() * (states[frame + 1].point(hit) - next.centre);
                    if then.z <= 0.0 {
                        continue;
                    }
                    let at = DVec2::new(then.x, then.y) / then.z * next.focal + next.principal;
                    let from = View::pixel(pixel % width, pixel / width);
                    let found = DVec2::new(flow[2 * pixel].into(), flow[2 * pixel + 1].into());
                    assert!((at - from).distance(found) < 1e-3 * (1.0 + found.length()), "{at} {from} {found}");
                    let stays = states[frame].point(hit).distance(states[frame + 1].point(hit)) == 0.0;
                    still += usize::from(stays);
                    moving += usize::from(!stays);
                }
            }
            assert!(
                !out.join(format!("flow/cam_{camera:02}/frame_0002.npy")).exists(),
                "no frame comes after the last"
            );
        }
        assert!(flat > 500 && still > 500 && moving > 10, "{flat} {still} {moving}");
    }
}
