"""tools/compare --against REVISION: this tree and an earlier one of its own, in one run, interleaved.

The earlier tree is unpacked and built under .tools/compare/REVISION; the first time takes as long as two release builds. Both run the
same cases through the same benches, so that a ratio says what the commits between them cost or brought.
"""

import io
import os
import shutil
import subprocess
import tarfile
import tempfile
from array import array

from programs import (
    HEIGHT, HOME, PICTURE, ROOT, WIDTH, Missing, Program, bench, call, checkpoint, medians, omnix, one, say, small,
)

NETWORK, KERNELS = "network", "kernels"


class Earlier:
    """The tree of an earlier commit, and where its programs are built."""

    def __init__(self, revision):
        command = ["git", "rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}"]
        self.commit = call(command, f"git knows no commit {revision}").strip()
        self.name = self.commit[:7]
        self.root = HOME / self.name
        self.env = {**os.environ, "CARGO_TARGET_DIR": str(HOME / f"{self.name}-target")}
        if not self.root.exists():
            archive = subprocess.run(["git", "archive", self.commit], cwd=ROOT, capture_output=True, check=True).stdout
            scratch = HOME / f"{self.name}.part"
            shutil.rmtree(scratch, ignore_errors=True)
            with tarfile.open(fileobj=io.BytesIO(archive)) as tree:
                tree.extractall(scratch, filter="data")
            scratch.rename(self.root)

    def bench(self, name):
        return bench(name, self.root, self.env)

    def omnix(self):
        return omnix(self.root, self.env)


def compare(out, runs, revision, kernels):
    """Fills `out` with everything that both trees can do; `kernels` names cases of the kernel bench."""
    earlier = Earlier(revision)
    # Everything is built before anything is timed.
    ours = {name: bench(name) for name in (NETWORK, KERNELS)} | {"omnix": omnix()}
    theirs = {name: earlier.bench(name) for name in (NETWORK, KERNELS)} | {"omnix": earlier.omnix()}
    out.notes["earlier"] = f"{earlier.commit}, {subject(earlier.commit)}"
    for part in (network, photo):
        try:
            part(out, runs, earlier.name, ours, theirs)
        except Missing as reason:
            out.missing(f"{part.__name__}: {reason}")
    compare_kernels(out, runs, earlier.name, ours, theirs, kernels)


def subject(commit):
    return call(["git", "log", "-1", "--format=%s", commit], "git cannot read its log").strip()


def network(out, runs, name, ours, theirs):
    programs = [Program([ours[NETWORK], "--serve"], "omnix"), Program([theirs[NETWORK], "--serve"], name)]
    try:
        folder = checkpoint(programs[0])
        for count in (1, 2, 4):
            say(f"small network, {count} images")
            with tempfile.TemporaryDirectory(dir=HOME) as scratch:
                size = {"count": count, "height": HEIGHT, "width": WIDTH}
                programs[0].do("pictures", file=f"{scratch}/pictures", **size)
                ready = {"weights": str(folder), "pictures": f"{scratch}/pictures", "f16": False, **size}
                out.notes["device"] = [program.do("prepare", **ready)["device"] for program in programs][0]
                # The first of both is warm-up.
                samples = [[program.do("go") for program in programs] for _ in range(runs + 1)][1:]
                for program, file in zip(programs, ("ours", "theirs")):
                    program.do("depth", file=f"{scratch}/{file}")
                apart = difference(f"{scratch}/ours", f"{scratch}/theirs")
            mine, other = (medians(column) for column in zip(*samples))
            out.add(f"small_{count}", f"small network, {count} images", name, mine, other, apart=apart)
    finally:
        for program in programs:
            program.close()


def difference(ours, theirs):
    """The mean difference of two files of f32, over the mean of the second."""
    mine, other = (array("f", open(file, "rb").read()) for file in (ours, theirs))
    if len(mine) != len(other):
        raise Missing(f"{len(mine)} depths here, {len(other)} in the earlier tree")
    return sum(abs(a - b) for a, b in zip(mine, other)) / sum(map(abs, other))


def photo(out, runs, name, ours, theirs):
    say("one JPEG to a depth file")
    samples = []
    # The first pair fills the caches.
    for _ in range(runs + 1):
        with tempfile.TemporaryDirectory(dir=HOME) as scratch:
            given = ["reconstruct", PICTURE, "--weights", small(), "--export", "depth", "--out"]
            pair = [one([program["omnix"], *given, f"{scratch}/{n}"])[0] for n, program in enumerate((ours, theirs))]
        samples.append(pair)
    mine, other = (medians(column) for column in zip(*samples[1:]))
    out.add("photo", "one JPEG to a depth file", name, mine, other)
    peaks = [sorted(sample["peak"] for sample in column)[len(column) // 2] for column in zip(*samples)]
    out.add_memory("photo_memory", "peak resident memory of that process", name, *peaks)


def compare_kernels(out, runs, name, ours, theirs, cases):
    """Every run is a new process of each, and the two take turns at being first: where the system puts a process (its pages, its
    threads) costs a kernel of few milliseconds up to a tenth, and stays as it is while the process lives."""
    samples = {case: [] for case in cases}
    for turn in range(runs):
        say(f"kernels, run {turn + 1} of {runs}")
        programs = [Program([ours[KERNELS], "--serve"], "omnix"), Program([theirs[KERNELS], "--serve"], name)]
        order = (0, 1) if turn % 2 else (1, 0)
        try:
            # Each says what machine it is on.
            for program in programs:
                program.line()
            for case in [case for case in cases if case in samples]:
                try:
                    answers = {side: answer(programs[side], case) for side in order}
                except Missing as reason:
                    out.missing(f"{case}: {reason}")
                    del samples[case]
                    continue
                samples[case].append((answers[0], answers[1]))
        finally:
            for program in programs:
                program.close()
    for case, pairs in samples.items():
        mine, other = (medians(column) for column in zip(*pairs))
        out.add(case.replace(" ", "_"), case, name, mine, other)


def answer(program, case):
    """The one answer to a case, which an empty line ends."""
    found = program.ask(case)
    while program.line():
        raise Missing(f"`{case}` is the name of several cases")
    return found
