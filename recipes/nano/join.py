"""Joins two checkpoints: join.py BASE OTHER OUT. OUT has all tensors of BASE, with the numbers of OTHER where that has them, and BASE's
configuration with the gate and the rest that the embedded network has. Nothing but Python's own library is needed.
"""

import json
import struct
import sys
from pathlib import Path


def read(folder):
    """Entries of the header, and their bytes, by name."""
    data = (folder / "model.safetensors").read_bytes()
    length = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8 : 8 + length])
    header.pop("__metadata__", None)
    begin = 8 + length
    return {name: (entry, data[begin + entry["data_offsets"][0] : begin + entry["data_offsets"][1]]) for name, entry in header.items()}


def main():
    base, other, out = map(Path, sys.argv[1:4])
    below, above = read(base), read(other)
    header, parts, end = {"__metadata__": {"format": "pt"}}, [], 0
    for name in sorted(below):
        entry, numbers = above.get(name, below[name])
        assert (entry["shape"], entry["dtype"]) == (below[name][0]["shape"], below[name][0]["dtype"]), name
        header[name] = {"dtype": entry["dtype"], "shape": entry["shape"], "data_offsets": [end, end + len(numbers)]}
        end += len(numbers)
        parts.append(numbers)
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    config = json.loads((base / "config.json").read_text())
    gate = {"kind": "hard", "infer": 0.3, "train": 0.5}
    config["trajectory"].update(motion_gate=gate, field_rest=[1, 0, 0, 0, 1, 0, 0, 0, 0])
    out.mkdir(parents=True, exist_ok=True)
    (out / "model.safetensors").write_bytes(struct.pack("<Q", len(text)) + text + b"".join(parts))
    (out / "config.json").write_text(json.dumps(config, indent=1) + "\n")


main()
