"""The network of the Python package `depth-anything-3` on the processor, for tools/compare: runs in the package's own virtual
environment. As benches/network, every line of standard input is a command in JSON, answered by one line of JSON.

The whole network as the package runs it (with its ray branch, which it cannot leave out), in f32, without gradients, on the
threads that OMP_NUM_THREADS says. With `photo PICTURE WEIGHTS OUT` it does one picture from file to file instead.
"""

import json
import os
import sys
import time
import warnings

warnings.simplefilter("ignore")
# The package logs to standard output, where the answers go.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import numpy as np
import torch
from depth_anything_3.cfg import create_object, load_config
from depth_anything_3.registry import MODEL_REGISTRY
from safetensors.torch import load_file

MEAN, STD = [0.485, 0.456, 0.406], [0.229, 0.224, 0.225]
# Tensors of outputs that the network makes and never uses; checkpoints may lack them.
UNREAD = "head.scratch.output_conv2_aux."


def load(folder):
    """The network of a folder with config.json and model.safetensors."""
    with open(os.path.join(folder, "config.json")) as file:
        name = json.load(file)["model_name"]
    network = create_object(load_config(MODEL_REGISTRY[name])).eval()
    stored = load_file(os.path.join(folder, "model.safetensors"))
    stored = {key.removeprefix("model."): value for key, value in stored.items()}
    missing, unexpected = network.load_state_dict(stored, strict=False)
    missing = [key for key in missing if not key.startswith(UNREAD)]
    if missing or unexpected:
        raise ValueError(f"the checkpoint lacks {missing[:5]}, has {unexpected[:5]} too much")
    return network


class Ready:
    """A network and its pictures."""

    def __init__(self, weights, pictures, count, height, width):
        self.network = load(weights)
        numbers = np.fromfile(pictures, np.float32)[: count * 3 * height * width]
        self.pictures = torch.from_numpy(numbers.reshape(1, count, 3, height, width))

    def run(self):
        with torch.inference_mode():
            return self.network(self.pictures).depth[0].float().numpy()


ready = None


def answer(command):
    """Carries out one command."""
    global ready
    what = command.pop("do")
    before, processor = time.perf_counter(), time.process_time()
    if what == "prepare":
        ready = None
        command.pop("f16")
        ready = Ready(**command)
        ready.run()
        threads, capability = torch.get_num_threads(), torch.backends.cpu.get_cpu_capability()
        device = f"PyTorch {torch.__version__.split('+')[0]}, {capability}, {threads} threads"
        return {"first": time.perf_counter() - before, "device": device}
    if what == "go":
        ready.run()
        used = time.process_time() - processor
        return {"wall": time.perf_counter() - before, "quiet": used / len(os.sched_getaffinity(0))}
    if what == "compare":
        mine, theirs = ready.run().ravel(), np.fromfile(command["file"], np.float32)
        apart = np.abs(mine - theirs)
        return {"largest": float((apart / np.abs(mine)).max()), "mean": float(apart.mean() / np.abs(mine).mean())}
    raise ValueError(f"unknown command {what}")


def photo(picture, weights, out):
    """One picture to a 16-bit depth PNG: the least that a program around the package does."""
    from PIL import Image

    image = Image.open(picture).convert("RGB")
    scale = 504 / max(image.size)
    size = [max(14, round(side * scale / 14) * 14) for side in image.size]
    pixels = np.asarray(image.resize(size, Image.BICUBIC), np.float32) / 255
    pixels = ((pixels - np.float32(MEAN)) / np.float32(STD)).transpose(2, 0, 1)
    with torch.inference_mode():
        depth = load(weights)(torch.from_numpy(np.ascontiguousarray(pixels))[None, None]).depth[0, 0].numpy()
    Image.fromarray((depth / depth.max() * 65535).astype(np.uint16)).save(out)


if sys.argv[1:2] == ["photo"]:
    photo(*sys.argv[2:])
    sys.exit()
for line in sys.stdin:
    try:
        text = answer(json.loads(line))
    except Exception as error:
        text = {"error": f"{type(error).__name__}: {error}"}
    print(json.dumps(text), file=answers, flush=True)
