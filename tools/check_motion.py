"""Checks of the exports of motion, called by check_outputs.py: numpy and Pillow, no code of ours.

Formats are described in crates/omnix-io/src/output/{tracks,st4rtrack,omx4d,masks,glb_motion,field}.rs.
"""

import hashlib
import json
import struct


def check_tracks(folder):
    import numpy as np

    files = sorted((folder / "exports/tracks").glob("*.npz"))
    points = still = 0
    errors = []
    for path in files:
        data = np.load(path, allow_pickle=False)
        trajectory, theta = data["trajectory"], data["theta"]
        times = len(data["times"])
        source = int(data["source"][0])
        assert path.stem == f"{source:06d}", f"{path.name} holds image {source}"
        assert trajectory.dtype == np.float32 and trajectory.shape == (times, *theta.shape, 3), trajectory.shape
        assert data["confidence"].shape == theta.shape == data["moving"].shape, "shapes of point arrays"
        assert data["rgb"].shape == (*theta.shape, 3) and data["rgb"].dtype == np.uint8, "rgb"
        assert data["extrinsics"].shape == (times, 3, 4) and data["intrinsics"].shape == (times, 3, 3), "cameras"
        assert data["video"].shape == data["frame"].shape == (times,), "video, frame"
        finite = np.isfinite(trajectory).all((0, -1))
        fixed = finite & ~data["moving"]
        assert (trajectory[:, fixed] == trajectory[source][fixed]).all(), "a point whose gate is shut moves"
        if "pixel" in data and len(theta):
            # At its own time a point projects onto its own pixel as well as the network's points and cameras agree.
            w2c, k = data["extrinsics"][source].astype(float), data["intrinsics"][source].astype(float)
            camera = trajectory[source][finite].astype(float) @ w2c[:, :3].T + w2c[:, 3]
            seen = camera @ k.T
            front = seen[:, 2] > 1e-6
            error = np.abs(seen[front, :2] / seen[front, 2:] - data["pixel"][finite][front])
            errors.extend(error.ravel())
        points, still = points + theta.size, still + int(fixed.sum())
    off = f"; at their own times {np.median(errors):.2g} pixels off (median)" if errors else ""
    return f"{len(files)} images, {points} points, {still} of them still{off}"


def check_st4rtrack(folder):
    """As St4RTrack's viewer loads it: sorted by number, stacked, reshaped."""
    import numpy as np

    shapes = set()
    counts = []
    for kind in ("pts3d1", "pts3d2", "conf1", "conf2"):
        paths = sorted(folder.glob(f"{kind}_p*.npy"), key=lambda p: int(p.stem.split("_p")[-1]))
        assert paths, f"no {kind}"
        stack = np.stack([np.load(p) for p in paths])
        assert stack.dtype == np.float32 and np.isfinite(stack).all(), kind
        if kind.startswith("pts3d"):
            assert stack.ndim == 4 and stack.shape[-1] == 6, stack.shape
            assert 0 <= stack[..., 3:].min() and stack[..., 3:].max() <= 1, "colours"
        shapes.add(stack.shape[1:3])
        counts.append(len(paths))
    assert len(shapes) == 1, shapes
    # A run that was cut off may lack the later images' own points.
    return f"{counts[0]} times, {counts[1]} images of {shapes.pop()}"


def check_omx4d(path):
    import numpy as np

    raw = path.read_bytes()
    assert raw[:8] == b"OMX4D\r\n\x1a", "magic"
    version, length = struct.unpack("<II", raw[8:16])
    assert version == 1, version
    text = raw[16 : 16 + length].decode()
    header = json.loads(text)
    assert json.dumps(header, sort_keys=True, separators=(",", ":"), ensure_ascii=False) == text, "header is not as Python writes it"
    names = {"float32": "<f4", "uint8": "u1", "uint16": "<u2"}
    arrays, end = {}, 16 + length
    for name in ("positions", "colors", "dynamicScore", "sourceView", "cameraPose", "intrinsics"):
        entry = header["attributes"][name]
        assert entry["offset"] == (end + 7) // 8 * 8, f"{name} is not at the next multiple of 8"
        count = int(np.prod(entry["shape"]))
        arrays[name] = np.frombuffer(raw, names[entry["dtype"]], count, entry["offset"]).reshape(entry["shape"])
        end = entry["offset"] + entry["byteLength"]
        assert arrays[name].nbytes == entry["byteLength"], name
    assert end == len(raw), "bytes after the last section"
    positions, score = arrays["positions"], arrays["dynamicScore"]
    assert positions.shape == (header["frameCount"], header["pointCount"], 3), positions.shape
    assert np.isfinite(positions).all() and (0 <= score).all() and (score <= 1).all(), "values"
    assert header["bounds"]["min"] == positions.min((0, 1)).tolist(), "bounds"
    assert header["bounds"]["max"] == positions.max((0, 1)).tolist(), "bounds"
    assert (np.diff(arrays["sourceView"].astype(int)) >= 0).all(), "points are not in order"
    poses = arrays["cameraPose"].astype(float)
    error = np.abs(poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1) - np.eye(3)).max()
    assert error < 1e-3, f"rotations are off orthonormal by {error}"
    assert len(header["sampling"]["identityHash"]) == hashlib.sha256().digest_size * 2, "identityHash"
    return f"{header['frameCount']} times, {header['pointCount']} points"


def check_masks(folder):
    import numpy as np
    from PIL import Image

    files = sorted((folder / "masks").glob("*.png"))
    moving = total = 0
    for path in files:
        mask = np.asarray(Image.open(path))
        theta = np.asarray(Image.open(folder / "theta" / path.name))
        assert mask.dtype == np.uint8 and mask.ndim == 2 and set(np.unique(mask)) <= {0, 255}, path.name
        assert theta.dtype in (np.uint16, np.int32) and theta.shape == mask.shape, path.name
        if (mask == 255).any() and (mask == 0).any():
            assert theta[mask == 255].min() >= theta[mask == 0].max(), f"{path.name}: mask and score disagree"
        moving, total = moving + int((mask == 255).sum()), total + mask.size
    return f"{len(files)} images, {100 * moving / max(1, total):.1f} % of the pixels move"


def read_glb(path):
    raw = path.read_bytes()
    magic, version, total, length = struct.unpack("<4sIII", raw[:16])
    assert (magic, version, total) == (b"glTF", 2, len(raw)), "header"
    return json.loads(raw[20 : 20 + length]), raw[28 + length :]


def has_motion(path):
    return any(n.get("name") == "moving points" for n in read_glb(path)[0].get("nodes", []))


def check_glb_motion(path):
    """Plays the file with numpy: bounds, key times, one neighbour after the other, still points without targets."""
    import numpy as np

    document, buffer = read_glb(path)
    kinds = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}

    def array(number):
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        dtype = {5126: "<f4", 5123: "<u2"}[accessor["componentType"]]
        size = kinds[accessor["type"]]
        values = np.frombuffer(buffer, dtype, accessor["count"] * size, view["byteOffset"]).reshape(-1, size)
        if "min" in accessor:
            assert (values.min(0) == np.float32(accessor["min"])).all(), f"minimum of accessor {number}"
            assert (values.max(0) == np.float32(accessor["max"])).all(), f"maximum of accessor {number}"
        return values

    nodes = {n["name"]: (i, n) for i, n in enumerate(document["nodes"])}
    node, moving = nodes["moving points"]
    primitive = document["meshes"][moving["mesh"]]["primitives"][0]
    base = array(primitive["attributes"]["POSITION"])
    targets = [array(t["POSITION"]) for t in primitive.get("targets", [])]
    assert all(t.shape == base.shape for t in targets), "targets"
    if "static points" in nodes:
        still = document["meshes"][nodes["static points"][1]["mesh"]]["primitives"][0]
        assert "targets" not in still, "static points have targets"
    times, farthest = 1, 0.0
    for animation in document.get("animations", []):
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            keys, values = array(sampler["input"]).ravel(), array(sampler["output"])
            assert (np.diff(keys) > 0).all(), "key times do not ascend"
            if channel["target"]["path"] == "rotation":
                assert np.abs(np.linalg.norm(values, axis=1) - 1).max() < 1e-5, "rotations are no unit quaternions"
                assert (np.sum(values[1:] * values[:-1], 1) >= 0).all(), "a rotation takes the long way"
            if channel["target"] == {"node": node, "path": "weights"}:
                times = len(keys)
                assert (values.reshape(times, -1) == np.eye(times)[:, 1:]).all(), "weights are not one at a time"
    assert times == len(targets) + 1, f"{times} key times, {len(targets)} targets"
    for target in targets:
        assert np.isfinite(target).all(), "targets"
        farthest = max(farthest, float(np.linalg.norm(target, axis=1).max(initial=0)))
    return f"{len(base)} points at {times} times, the farthest moves {farthest:.3g}"


def check_field(path):
    raw = path.read_bytes()
    (length,) = struct.unpack("<Q", raw[:8])
    header = json.loads(raw[8 : 8 + length])
    meta = header.pop("__metadata__")
    assert (meta["format"], meta["version"]) == ("omnix-field", "2"), meta
    end = 0
    for name, entry in sorted(header.items(), key=lambda item: item[1]["data_offsets"]):
        count = 1
        for n in entry["shape"]:
            count *= n
        first, last = entry["data_offsets"]
        size = {"F32": 4, "F16": 2, "F64": 8, "U32": 4}[entry["dtype"]]
        assert first == end and last - first == count * size, name
        end = last
    assert 8 + length + end == len(raw), "length of the file"
    return f"{len(header)} tensors, {len(raw)} bytes"


def check_lists(folder):
    """The table and the sequence of PLY files hold the same points at the same times."""
    import numpy as np
    from plyfile import PlyData

    table = np.genfromtxt(folder / "tracks.csv", delimiter=",", names=True)
    files = sorted((folder / "exports/ply_seq").glob("*.ply"))
    assert len(table) % len(files) == 0, f"{len(table)} lines for {len(files)} times"
    worst = 0.0
    for time, path in enumerate(files):
        vertex = PlyData.read(str(path))["vertex"]
        rows = table[table["time"] == time]
        assert (rows["image"] == vertex["image"]).all() and (rows["column"] == vertex["column"]).all(), path.name
        worst = max(worst, max(np.abs(rows[axis] - vertex[axis]).max() for axis in "xyz"))
    assert worst < 1e-5, f"{worst} apart"
    return f"{vertex.count} points at {len(files)} times"


def check_usda(folder):
    """Opened by Pixar's own library: a camera sees a point where the archive's matrices say it is."""
    import numpy as np
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.Open(str(folder / "scene.usda"))
    points = UsdGeom.Points(stage.GetPrimAtPath("/scene/points"))
    times = int(stage.GetEndTimeCode()) + 1
    manifest = json.loads((folder / "manifest.json").read_text())
    npz = folder / "exports/npz/results.npz"
    worst = 0.0
    for time in range(times):
        positions = np.array(points.GetPointsAttr().Get(time), float)
        assert np.isfinite(positions).all() and len(positions) == len(points.GetPrim().GetAttribute("primvars:displayColor").Get())
        camera = UsdGeom.Camera(stage.GetPrimAtPath(f"/scene/camera_{manifest['images'][time]['video']}")).GetCamera(time)
        if not npz.exists():
            continue
        data = np.load(npz)
        w2c, k = data["extrinsics"][time].astype(float), data["intrinsics"][time].astype(float)
        height, width = data["depth"].shape[1:]
        see = np.array(camera.frustum.ComputeViewMatrix() * camera.frustum.ComputeProjectionMatrix())
        for point in positions[:: max(1, len(positions) // 50)]:
            at = w2c[:, :3] @ (point * [1, -1, -1]) + w2c[:, 3]
            if at[2] < 0.1:
                continue
            x, y, _, w = np.append(point, 1) @ see
            pixel = np.array([(x / w + 1) / 2 * width, (1 - y / w) / 2 * height])
            worst = max(worst, np.abs(pixel - (k @ at)[:2] / at[2]).max())
    assert worst < 0.05, f"a point is {worst} pixels off"
    return f"{len(positions)} points at {times} times, cameras at most {worst:.2g} pixels off"


def plan(folder):
    """(name, needed modules, function) of every check of motion that the folder's files ask for."""
    checks = []
    if (folder / "exports/tracks").is_dir():
        checks.append(("tracks", ["numpy"], lambda: check_tracks(folder)))
    if (folder / "exports/st4rtrack").is_dir():
        checks.append(("st4rtrack", ["numpy"], lambda: check_st4rtrack(folder / "exports/st4rtrack")))
    if (folder / "scene.usda").exists():
        checks.append(("scene.usda", ["numpy", "pxr"], lambda: check_usda(folder)))
    if (folder / "tracks.csv").exists() and (folder / "exports/ply_seq").is_dir():
        checks.append(("tracks.csv = ply_seq", ["numpy", "plyfile"], lambda: check_lists(folder)))
    if (folder / "scene.omx4d").exists():
        checks.append(("scene.omx4d", ["numpy"], lambda: check_omx4d(folder / "scene.omx4d")))
    if (folder / "masks").is_dir():
        checks.append(("masks", ["numpy", "PIL"], lambda: check_masks(folder)))
    if (folder / "scene.glb").exists() and has_motion(folder / "scene.glb"):
        checks.append(("scene.glb motion", ["numpy"], lambda: check_glb_motion(folder / "scene.glb")))
    if (folder / "field.safetensors").exists():
        checks.append(("field.safetensors", [], lambda: check_field(folder / "field.safetensors")))
    return checks
