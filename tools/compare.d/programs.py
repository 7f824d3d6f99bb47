"""What the parts of tools/compare share: programs that answer lines of text, whole processes, medians."""

import json
import os
import queue
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
HOME = ROOT / ".tools/compare"
THREADS = 2
HEIGHT, WIDTH = 280, 504
# One picture of a committed clip.
PICTURE = ROOT / "assets/clips/mobile_robot/000.jpg"


class Missing(Exception):
    """A part that cannot be had, and why."""


def say(text):
    print(text, file=sys.stderr, flush=True)


def call(command, what, **more):
    """Runs a command to its end; its complaints are the reason if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, **{"cwd": ROOT, **more})
    if done.returncode:
        raise Missing(f"{what}: {(done.stderr or done.stdout).strip()[-400:]}")
    return done.stdout


class Program:
    """A program that answers lines of text."""

    def __init__(self, command, name):
        self.name, self.answers = name, queue.Queue()
        self.log = tempfile.TemporaryFile("w+")
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": self.log}
        self.process = subprocess.Popen(command, cwd=ROOT, text=True, **pipes)
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for line in self.process.stdout:
            self.answers.put(line.rstrip("\n"))
        self.answers.put(None)

    def line(self, timeout=300):
        try:
            text = self.answers.get(timeout=timeout)
        except queue.Empty:
            raise Missing(f"{self.name}: no answer in {timeout} s") from None
        if text is None:
            self.log.seek(0)
            raise Missing(f"{self.name} ended: {self.log.read().strip()[-400:]}")
        return text

    def ask(self, question):
        try:
            self.process.stdin.write(question + "\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            pass  # The answer says why.
        answer = json.loads(self.line())
        if "error" in answer:
            raise Missing(f"{self.name}: {answer['error']}")
        return answer

    def do(self, what, **more):
        return self.ask(json.dumps({"do": what, **more}))

    def close(self):
        self.process.kill()
        self.process.wait()


def bench(name, root=ROOT, env=None):
    """Builds one of our benches, of the tree at `root`, and gives its path."""
    say(f"building the bench {name} of {root}")
    command = ["cargo", "bench", "-q", "-p", "omnix-benches", "--bench", name, "--no-run", "--message-format=json"]
    for line in call(command, "omnix does not build", cwd=root, env=env).splitlines():
        message = json.loads(line)
        if message.get("executable") and message["target"]["name"] == name:
            return message["executable"]
    raise Missing(f"cargo names no program for the bench {name}")


def medians(samples):
    """Median by the wall and of processor time."""
    quiet = [s["quiet"] for s in samples if s.get("quiet") is not None]
    return {"wall": statistics.median(s["wall"] for s in samples), "quiet": statistics.median(quiet) if quiet else None}


def checkpoint(ours):
    """The folder with random weights of the small network, written once."""
    folder = HOME / "small"
    if not (folder / "model.safetensors").exists():
        ours.do("checkpoint", network="da3-small", dir=str(folder))
    return folder


def one(command):
    """Seconds and peak resident bytes of a process from start to end, and the lines that it printed."""
    with tempfile.TemporaryFile("w+") as log, tempfile.TemporaryFile("w+") as printed:
        before = time.perf_counter()
        process = subprocess.Popen(command, cwd=ROOT, stdout=printed, stderr=log)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - before
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            log.seek(0)
            raise Missing(f"{command[0]}: {log.read().strip()[-400:]}")
        printed.seek(0)
        lines = printed.read().splitlines()
    used = {"wall": wall, "quiet": (usage.ru_utime + usage.ru_stime) / THREADS, "peak": usage.ru_maxrss * 1024}
    return used, lines


def omnix(root=ROOT, env=None):
    """Builds the program of the tree at `root` and gives its path."""
    say(f"building omnix of {root}")
    call(["cargo", "build", "-q", "--release", "-p", "omnix-cli"], "omnix does not build", cwd=root, env=env)
    return Path((env or os.environ).get("CARGO_TARGET_DIR", root / "target")) / "release/omnix"


def small():
    """The folder of `checkpoint`, by a program of its own where it is not there."""
    if (HOME / "small/model.safetensors").exists():
        return HOME / "small"
    ours = Program([bench("network"), "--serve"], "omnix")
    try:
        return checkpoint(ours)
    finally:
        ours.close()
