#!/usr/bin/env python3
"""Checks a result folder of `omnix reconstruct` with readers that are not ours.

Usage: check_outputs.py FOLDER

Uses numpy, plyfile, Pillow, evo, pycolmap and pxr where they are installed (pip install numpy plyfile pillow evo pycolmap
usd-core) and says which were not. For scene.glb it calls check_glb.mjs beside it when node is there (npm install gltf-validator; NODE_PATH may
name the folder node_modules). Exports of motion are checked by check_motion.py beside it. Prints one line a check; exit code 0 only if every check that ran passed and at least
one ran.
"""

import importlib.util
import json
import os
import pathlib
import shutil
import subprocess
import sys

import check_motion

HERE = pathlib.Path(__file__).resolve().parent


def have(module):
    return importlib.util.find_spec(module) is not None


def check_manifest(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["format"] == "omnix-manifest-1", manifest["format"]
    for key in ("conventions", "unit_of_length", "weights", "device", "versions", "images", "files", "interrupted"):
        assert key in manifest, f"no {key}"
    for file in manifest["files"]:
        assert (folder / file["path"]).is_file(), f"{file['path']} is listed but missing"
    indices = [image["index"] for image in manifest["images"]]
    assert indices == list(range(len(indices))), "indices are not 0..n"
    return f"{len(indices)} images, {len(manifest['files'])} files, interrupted: {manifest['interrupted']}"


def check_npz(path):
    import numpy as np

    data = np.load(path, allow_pickle=False)
    depth = data["depth"]
    count, height, width = depth.shape
    assert depth.dtype == np.float32 and np.isfinite(depth).all() and (depth >= 0).all(), "depth"
    if "image" in data:
        assert data["image"].shape == (count, height, width, 3) and data["image"].dtype == np.uint8, "image"
    if "conf" in data:
        assert data["conf"].shape == depth.shape and np.isfinite(data["conf"]).all(), "conf"
    if "extrinsics" in data:
        extrinsics, intrinsics = data["extrinsics"], data["intrinsics"]
        assert extrinsics.shape == (count, 3, 4) and intrinsics.shape == (count, 3, 3), "camera shapes"
        rotation = extrinsics[:, :, :3].astype(np.float64)
        error = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max()
        assert error < 1e-3, f"rotations are off orthonormal by {error}"
        assert (intrinsics[:, 0, 0] > 0).all() and (intrinsics[:, 2, 2] == 1).all(), "intrinsics"
    return f"{count} x {height} x {width}, arrays {', '.join(data.files)}, depth {depth.min():.4g} to {depth.max():.4g}"


def check_ply(path):
    import numpy as np
    from plyfile import PlyData

    vertex = PlyData.read(str(path))["vertex"]
    names = [p.name for p in vertex.properties]
    assert names == ["x", "y", "z", "red", "green", "blue", "confidence"], names
    for name in ("x", "y", "z", "confidence"):
        assert np.isfinite(vertex[name]).all(), name
    return f"{vertex.count} points"


def check_depth(folder):
    import numpy as np
    from PIL import Image

    sidecar = json.loads((folder / "depth/depth.json").read_text())
    for entry in sidecar["images"]:
        picture = Image.open(folder / entry["file"])
        text = picture.info.get("omnix:depth_scale")
        values = np.asarray(picture)
        assert values.dtype in (np.uint16, np.int32) and values.ndim == 2, f"{entry['file']} is {values.dtype}"
        assert text is not None and float(text) == entry["scale"], f"{entry['file']}: scale {text} in the file"
        assert (values == 0).sum() == entry["invalid_pixels"], entry["file"]
        if entry["depth_max"] is not None:
            error = abs(int(values.max()) * entry["scale"] - entry["depth_max"])
            assert error <= entry["scale"], f"{entry['file']}: maximum is off by {error}"
        colour = Image.open(folder / entry["color_file"])
        assert colour.mode == "RGB" and colour.size == picture.size, entry["color_file"]
    return f"{len(sidecar['images'])} pictures"


def check_depth_against_npz(folder):
    import numpy as np
    from PIL import Image

    depth = np.load(folder / "exports/npz/results.npz")["depth"]
    worst = 0.0
    for entry in json.loads((folder / "depth/depth.json").read_text())["images"]:
        values = np.asarray(Image.open(folder / entry["file"])).astype(np.float64) * entry["scale"]
        # The npz is rounded to 6 decimals, which is part of a step where depths are small.
        apart = np.maximum(np.abs(values - depth[entry["index"]]) - 5.1e-7, 0)
        worst = max(worst, apart[values > 0].max() / entry["scale"])
    assert worst <= 0.51, f"{worst} steps apart"
    return f"at most {worst:.3f} steps apart"


def check_ply_against_npz(folder):
    """Every 997th point must project onto a pixel of one of the images with that pixel's depth."""
    import numpy as np
    from plyfile import PlyData

    data = np.load(folder / "exports/npz/results.npz")
    vertex = PlyData.read(str(folder / "points.ply"))["vertex"]
    points = np.stack([vertex[n] for n in "xyz"], -1)[::997].astype(np.float64)
    best = np.full(len(points), np.inf)
    for depth, w2c, k in zip(data["depth"], data["extrinsics"].astype(float), data["intrinsics"].astype(float)):
        camera = points @ w2c[:, :3].T + w2c[:, 3]
        z = camera[:, 2]
        pixel = camera @ k.T
        with np.errstate(all="ignore"):
            u, v = pixel[:, 0] / z, pixel[:, 1] / z
            column, row = np.rint(u), np.rint(v)
        inside = (z > 0) & (column >= 0) & (row >= 0) & (column < depth.shape[1]) & (row < depth.shape[0])
        seen = depth[row[inside].astype(int), column[inside].astype(int)]
        error = np.abs(z[inside] - seen) / seen + np.hypot(u - column, v - row)[inside]
        best[inside] = np.minimum(best[inside], error)
    assert best.max() < 1e-2, f"a point is {best.max()} from any pixel"
    return f"{len(points)} points, worst {best.max():.2g}"


def check_tum(path):
    from evo.tools import file_interface

    trajectory = file_interface.read_tum_trajectory_file(str(path))
    valid, details = trajectory.check()
    # Photos have one pose each, which evo reads but calls no trajectory.
    assert valid or trajectory.num_poses < 2, details
    return f"{trajectory.num_poses} poses, {trajectory.path_length:.4g} long"


def check_tum_against_npz(folder):
    """The poses must be the inverses of the archive's world-to-camera matrices."""
    import numpy as np
    from evo.tools import file_interface

    extrinsics = np.load(folder / "exports/npz/results.npz")["extrinsics"].astype(np.float64)
    poses = np.stack(file_interface.read_tum_trajectory_file(str(folder / "trajectory.tum")).poses_se3)
    product = extrinsics @ poses
    error = np.abs(product - np.eye(4)[:3]).max() / max(1.0, np.abs(poses).max())
    assert len(poses) == len(extrinsics) and error < 1e-3, f"off by {error}"
    return f"{len(poses)} poses, worst {error:.2g}"


def check_colmap(folder):
    """Both forms of the model, read by COLMAP's own library: points project onto their observations."""
    import numpy as np
    import pycolmap

    told = []
    for form in ("sparse/0", "text"):
        model = pycolmap.Reconstruction(str(folder / "exports/colmap" / form))
        worst = 0.0
        for image in model.images.values():
            camera = model.cameras[image.camera_id]
            for observation in image.points2D[::37]:
                point = model.points3D[observation.point3D_id]
                seen = camera.img_from_cam(image.cam_from_world() * point.xyz)
                worst = max(worst, float(np.abs(seen - observation.xy).max()))
        assert worst < 1e-2, f"{form}: an observation is {worst} pixels from its point"
        told.append(f"{model.num_images()} images, {model.num_points3D()} points")
    assert told[0] == told[1], told
    return f"{told[0]}, both forms"


def check_cameras_against_npz(folder):
    """Poses of the model and of transforms.json must be those of the archive."""
    import numpy as np

    extrinsics = np.load(folder / "exports/npz/results.npz")["extrinsics"].astype(np.float64)
    told = []
    if (folder / "exports/colmap/text/images.txt").exists():
        lines = [l for l in (folder / "exports/colmap/text/images.txt").read_text().splitlines() if not l.startswith("#")]
        for line, w2c in zip(lines[::2], extrinsics):
            w, x, y, z, *t = map(float, line.split(" ")[1:8])
            turn = np.array([
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ])
            assert np.abs(np.c_[turn, t] - w2c).max() < 1e-4 * max(1, np.abs(w2c).max()), line
        told.append(f"{len(lines) // 2} of COLMAP")
    if (folder / "transforms.json").exists():
        frames = json.loads((folder / "transforms.json").read_text())["frames"]
        for frame, w2c in zip(frames, extrinsics):
            c2w = np.array(frame["transform_matrix"]) @ np.diag([1.0, -1.0, -1.0, 1.0])
            assert np.abs(np.linalg.inv(c2w)[:3] - w2c).max() < 1e-4 * max(1, np.abs(c2w).max()), frame["file_path"]
        told.append(f"{len(frames)} of transforms.json")
    return ", ".join(told)


def check_glb(path):
    done = subprocess.run(["node", str(HERE / "check_glb.mjs"), str(path)], capture_output=True, text=True)
    if done.returncode == 2:
        raise ModuleNotFoundError("gltf-validator")
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


def plan(folder):
    """(name, needed modules, function) of every check that the folder's files ask for."""
    checks = [("manifest.json", [], lambda: check_manifest(folder)), *check_motion.plan(folder)]
    npz = folder / "exports/npz/results.npz"
    for path in (npz, folder / "exports/mini_npz/results.npz"):
        if path.exists():
            checks.append((str(path.relative_to(folder)), ["numpy"], lambda p=path: check_npz(p)))
    if (folder / "points.ply").exists():
        checks.append(("points.ply", ["numpy", "plyfile"], lambda: check_ply(folder / "points.ply")))
        if npz.exists():
            checks.append(("points.ply = npz", ["numpy", "plyfile"], lambda: check_ply_against_npz(folder)))
    if (folder / "depth/depth.json").exists():
        checks.append(("depth", ["numpy", "PIL"], lambda: check_depth(folder)))
        if npz.exists():
            checks.append(("depth = npz", ["numpy", "PIL"], lambda: check_depth_against_npz(folder)))
    for path in sorted(folder.glob("trajectory*.tum")):
        checks.append((path.name, ["evo"], lambda p=path: check_tum(p)))
    if (folder / "trajectory.tum").exists() and npz.exists():
        checks.append(("trajectory.tum = npz", ["evo", "numpy"], lambda: check_tum_against_npz(folder)))
    if (folder / "exports/colmap").exists():
        checks.append(("exports/colmap", ["numpy", "pycolmap"], lambda: check_colmap(folder)))
    if npz.exists() and ((folder / "exports/colmap").exists() or (folder / "transforms.json").exists()):
        checks.append(("known cameras = npz", ["numpy"], lambda: check_cameras_against_npz(folder)))
    if (folder / "scene.glb").exists():
        checks.append(("scene.glb", [], lambda: check_glb(folder / "scene.glb")))
    return checks


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    passed = failed = 0
    for name, modules, check in plan(folder):
        missing = [m for m in modules if not have(m)]
        if name == "scene.glb" and not shutil.which("node"):
            missing = ["node"]
        if missing:
            print(f"skip {name}: {', '.join(missing)} not installed")
            continue
        try:
            print(f"pass {name}: {check()}")
            passed += 1
        except ModuleNotFoundError as error:
            print(f"skip {name}: {error} not installed")
        except Exception as error:  # every reader has exceptions of its own
            print(f"FAIL {name}: {type(error).__name__}: {error}")
            failed += 1
    sys.exit(0 if passed and not failed else 1)


if __name__ == "__main__":
    os.environ.setdefault("MPLBACKEND", "Agg")
    main()
