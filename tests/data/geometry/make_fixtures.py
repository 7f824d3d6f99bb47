"""Makes the fixtures of this folder from the recorded goldens of Depth Anything 3.

    python make_fixtures.py GOLDEN_DA3 .

GOLDEN_DA3 is the folder that holds tiny-a and tiny-b. geometry.safetensors (tiny-a) and raypose.safetensors (tiny-b) are
copied; posembed.safetensors keeps 4 of 64 channels of tiny-a's. Needs numpy and safetensors.
"""

import shutil
import sys
from pathlib import Path

from safetensors.numpy import load_file, save_file

CHANNELS = [0, 21, 42, 63]


def main(golden: Path, out: Path) -> None:
    shutil.copyfile(golden / "tiny-a/geometry.safetensors", out / "geometry.safetensors")
    shutil.copyfile(golden / "tiny-b/raypose.safetensors", out / "raypose.safetensors")
    rows = load_file(golden / "tiny-a/posembed.safetensors")
    save_file({name: row[..., CHANNELS].copy() for name, row in rows.items()}, out / "posembed.safetensors")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
