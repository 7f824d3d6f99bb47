#!/usr/bin/env python3
"""Makes golden.safetensors, terms.safetensors and their two .json files from ../../../../shared/golden (needs numpy and safetensors).

usage: make_fixtures.py GOLDEN_FOLDER TAU_FILE

golden.safetensors: predictions, targets and recorded gradients of omnix-train/case.safetensors that the objective's test needs. True
trajectories are kept as points at the own time, the paths of moving pixels, and which pixels are known at other times (all others stand
still). For every pixel above the gate of 0.5 its place (source image * H * W + row * W + column) and its sampled field tau [times, 9], since the
case records no trajectories but those of the first image. TAU_FILE holds tau of all pixels as f32 [image, H * W, 9 * times + 1]; it was
written by the goldens' test (tests/goldens/motion.rs, value `tau`) from the case's network; its last column is within 1e-5 of the recorded
out.pixel_score, and the trajectories of image 0 made from it are within 1.3e-5 of the recorded ones.
terms.safetensors: eval/losses.npz, names with dots.
"""
import json
import sys
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

golden, tau_file = Path(sys.argv[1]), Path(sys.argv[2])
here = Path(__file__).parent

case = load_file(golden / "omnix-train/case.safetensors")
keep = "out. gt. in.depth in.moving in.valid grad_output.".split()
out = {name: array for name, array in case.items() if any(name.startswith(start) for start in keep)}
del out["out.trajectory_first"]
for label in ("gt.moving_label", "gt.moving_label_token"):
    out[label] = out[label].astype(np.uint8)
images, height, width = case["in.depth"].shape
paths, moving = case["in.trajectory"], case["in.moving"] > 0
own = paths[np.arange(images), np.arange(images)]
out["true.own"] = np.ascontiguousarray(own)
out["true.moving"] = np.ascontiguousarray(paths.transpose(0, 2, 3, 1, 4)[moving])
out["true.known"] = np.isfinite(paths).all((1, 4)).astype(np.uint8)
again = np.repeat(own[:, None], images, 1).transpose(0, 2, 3, 1, 4).copy()
again[moving] = out["true.moving"]
again = again.transpose(0, 3, 1, 2, 4)
others = ~np.eye(images, dtype=bool)[:, :, None, None]
again[np.broadcast_to(~(out["true.known"][:, None] > 0) & others, again.shape[:4])] = np.nan
assert np.array_equal(again, paths, equal_nan=True), "the short form of the trajectories loses something"
tau = np.fromfile(tau_file, "<f4").reshape(images * height * width, -1)
gated = np.flatnonzero(case["out.pixel_score"].ravel() > 0.5)
out["gated.pixel"] = gated.astype(np.float32)
out["gated.tau"] = np.ascontiguousarray(tau[gated, :-1])
save_file(out, here / "golden.safetensors")
losses = json.loads((golden / "omnix-train/losses.json").read_text())["losses"]
(here / "golden.json").write_text(json.dumps(losses, indent=1) + "\n")

terms = np.load(golden / "eval/losses.npz")
save_file({name.replace("/", "."): np.ascontiguousarray(terms[name]) for name in terms.files}, here / "terms.safetensors")
cases = json.loads((golden / "eval/losses.json").read_text())["cases"]
(here / "terms.json").write_text(json.dumps(cases, indent=1) + "\n")
