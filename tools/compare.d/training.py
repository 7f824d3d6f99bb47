"""tools/compare --train: a training step here and in PyTorch, on the same processors, in runs that alternate.

Both start from random weights, and do forward, backward, the clip and AdamW in f32. A run is a process of a few steps; the first step of each
compiles and warms up, and is left out. Ours are `omnix train` as a user runs it, samples made meanwhile.
"""

import json
import statistics
import tempfile

from programs import HOME, ROOT, Missing, omnix, one, say

STEPS = 4
COMMON = """
steps = 100
augment = false
[optimiser]
clip = 1.0
[[data]]
made = "shapes"
[[group]]
name = ""
rate = 1e-4
"""
# The package's da3-small.
SMALL = """
[sample]
images = 2
size = [504, 280]
[loss]
preset = "paper"
slope_weight = 0.0
weights = { camera = 0.0 }
[network]
format = "omnix-1"
variant = "release"
name = "small"
points_from = "rays"
[network.backbone]
embed_dim = 384
depth = 12
heads = 6
mlp_ratio = 4
ffn = "mlp"
patch = 14
position_grid = 37
out_layers = [5, 7, 9, 11]
alternate_from = 4
qk_norm_from = 4
rope_from = 4
rope_base = 100
concat_local = true
reference_view = "first"
[network.depth_head]
features = 64
channels = [48, 96, 192, 384]
aux_convs = 5
logit_clamp = 10.0
"""
NANO = """
[sample]
images = 4
size = [140, 84]
[loss]
preset = "release"
"""


def compare(out, runs, interpreter, oracle):
    """Fills `out` with both networks; the one with motion where the folder `oracle` is given."""
    program = omnix()
    steps(out, runs, "train_small", "training step of small, 2 images of 504x280", SMALL, [interpreter, "small"], program)
    if oracle is None:
        out.missing("a step with trajectories: name the folder of omnix_v2.py with --oracle")
        return
    network = f'network = "{ROOT}/assets/weights/nano/config.json"\n'
    theirs = [interpreter, "nano", str(oracle)]
    steps(out, runs, "train_nano", "training step with trajectories, 4 images of 140x84", NANO, theirs, program, network)


def steps(out, runs, key, what, recipe, theirs, program, head=""):
    say(what)
    script = ROOT / "tools/compare.d/pytorch_train.py"
    interpreter, network, *more = theirs
    pairs = []
    with tempfile.TemporaryDirectory(dir=HOME) as scratch:
        path = f"{scratch}/recipe.toml"
        with open(path, "w") as file:
            file.write(head + COMMON + recipe)
        for turn in range(runs):
            command = [program, "train", path, "--out", f"{scratch}/{turn}", "--steps", str(STEPS), "--json"]
            ours, lines = one(command)
            seconds = [line["seconds"] for line in map(json.loads, lines) if line["event"] == "step"]
            other, lines = one([interpreter, script, network, str(STEPS), *more])
            pairs.append(((ours, seconds[1:]), (other, json.loads(lines[-1])["seconds"][1:])))
    median = lambda side: statistics.median(s for pair in pairs for s in pair[side][1])
    if any(not pair[side][1] for pair in pairs for side in (0, 1)):
        raise Missing(f"{what}: a run without steps")
    out.add(key, what, "pytorch", {"wall": median(0), "quiet": None}, {"wall": median(1), "quiet": None})
    peaks = [statistics.median(pair[side][0]["peak"] for pair in pairs) for side in (0, 1)]
    out.add_memory(f"{key}_memory", "peak resident memory of that process", "pytorch", *peaks)
