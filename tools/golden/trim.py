#!/usr/bin/env python3
"""Copies some tensors of a safetensors file into a smaller one: how tests/data/goldens was made.

usage: trim.py IN OUT NAME...     (a NAME ending in * takes every tensor that starts so)
"""
import json
import struct
import sys


def main(source, target, names):
    with open(source, "rb") as f:
        length = struct.unpack("<Q", f.read(8))[0]
        header = json.loads(f.read(length))
        body = f.read()
    wanted = lambda n: any(n == w or (w.endswith("*") and n.startswith(w[:-1])) for w in names)
    out, parts, at = {}, [], 0
    if "__metadata__" in header:
        out["__metadata__"] = header["__metadata__"]
    for name, info in header.items():
        if name == "__metadata__" or not wanted(name):
            continue
        start, end = info["data_offsets"]
        out[name] = dict(info, data_offsets=[at, at + end - start])
        parts.append(body[start:end])
        at += end - start
    text = json.dumps(out, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with open(target, "wb") as f:
        f.write(struct.pack("<Q", len(text)) + text + b"".join(parts))


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
