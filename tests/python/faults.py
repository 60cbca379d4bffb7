"""A folder with targets in it, and what may be there after a fault: of each target the old file or the whole new one."""
import contextlib
import fcntl
import json
import os
import re
import resource
import signal
import subprocess
import time

import pytest

import command
import report

# Every kind of output, some of them twice: the more files there are to rename, the more moments between two of them.
TARGETS = ("a.vdb", "b.exr", "c.png", "d.json", "e.glb", "f.vdb", "g.exr", "h.png", "i.json", "j.glb")
# A quarter of a second, and every stage has its share of it.
SHORT = ("--photons", "30k", "--max-voxels", "50k", "--size", "64x36", "--spp", "2", "--threads", "2", "--integrator", "path")
STAGES = ("import", "photons", "regions", "voxels", "vdb", "render")
PART = re.compile(r"\.(.+)\.\w{6}\.part")


def job(scene, *arguments, overwrite=False, targets=TARGETS):
    """A run in the folder: targets have relative names, so that each run's files are those of every other."""
    outputs = [part for name in targets for part in ("-o", name)]
    return [str(command.binary()), str(scene), *SHORT, *outputs, *["--overwrite"] * overwrite, *map(str, arguments)]


class Folder:
    """Where runs are disturbed; `whole` is what an undisturbed one writes."""

    def __init__(self, path, scene, targets=TARGETS):
        self.path, self.scene, self.targets, self.whole = path, scene, targets, {}
        path.mkdir(exist_ok=True)

    def learn(self, *arguments):
        """Runs undisturbed; returns the seconds that it takes."""
        begun = time.monotonic()
        self.run(*arguments, overwrite=True)
        seconds = time.monotonic() - begun
        self.whole = {name: content(name, (self.path / name).read_bytes()) for name in self.targets}
        return seconds

    def run(self, *arguments, code=0, **kwargs):
        return finish(self.start(*arguments, **kwargs), code)

    def start(self, *arguments, overwrite=False, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **kwargs):
        """Begins a run."""
        return subprocess.Popen(job(self.scene, *arguments, overwrite=overwrite, targets=self.targets), cwd=self.path, text=True,
                                env=command.environment(), stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr, **kwargs)

    def set_up(self, old):
        """Puts old files where targets will be, or nothing."""
        for name in self.targets:
            if old:
                (self.path / name).write_bytes(ancient(name))
            else:
                (self.path / name).unlink(missing_ok=True)

    def states(self, old):
        """Which targets are old and which are new; fails where one is neither."""
        found = []
        for name in self.targets:
            path = self.path / name
            there = path.read_bytes() if path.exists() else None
            if there == (ancient(name) if old else None):
                found.append("old")
            else:
                assert there is not None, f"{name} has disappeared"
                assert content(name, there) == self.whole[name], f"{name} is neither the old file nor the whole new one"
                found.append("new")
        return found

    def left(self):
        """What is in the folder beside targets."""
        return sorted(p.name for p in self.path.iterdir() if p.name not in self.targets)

    def writing(self):
        """Whether a run is past its look at the targets, and has something for one of them."""
        with contextlib.suppress(FileNotFoundError):
            return any((self.path / name).stat().st_size > 0 for name in self.left())

    def renaming(self):
        """Whether the first target is there, and not the old one."""
        first = self.path / self.targets[0]
        return first.exists() and first.stat().st_size > len(ancient(first.name))

    def check(self, code, err, old, late=False):
        """After an end other than by SIGKILL: all new with exit code 0, all old with another, and nothing else."""
        states, expected = self.states(old), "new" if code == 0 or late else "old"
        assert states == [expected] * len(self.targets), (code, states, err)
        assert self.left() == [], (code, self.left(), err)
        # The start of a thread without memory panics within Rust's own library, and aborts.
        assert "panicked" not in err or "alternative stack" in err, err


def ancient(name):
    return f"the old {name}\n".encode() * 40


def content(name, raw):
    """What is the same in each run: all bytes, of a report what is not a time."""
    if not name.endswith(".json"):
        return raw
    try:
        return json.dumps(report.stable(json.loads(raw)), sort_keys=True)
    except ValueError:
        return None


def sentence(err, *words):
    """One line for people, with these words; a tuple is a choice."""
    lines = err.splitlines()
    assert len(lines) == 1 and lines[0].startswith("cloudvdb: "), err
    for word in words:
        assert any(w in err for w in ([word] if isinstance(word, str) else word)), (word, err)


def limited(**limits):
    """For `preexec_fn`: limits by the names of the module resource; no core is dumped."""
    def set_limits():
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        for name, value in limits.items():
            resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), (value, value))
    return set_limits


def least_memory():
    """The address space, in MB, with which the libraries can be loaded: OpenVDB's start threads before the command begins."""
    for megabytes in range(40, 1000, 4):
        done = subprocess.run([command.binary(), "--version"], capture_output=True, preexec_fn=limited(AS=megabytes << 20))
        if done.returncode == 0:
            return megabytes
    pytest.fail(f"1 GB of address space is not enough: {done}")


def narrow_pipe():
    """The two ends of a pipe with little room, and how many bytes that is."""
    reading, writing = os.pipe()
    return reading, writing, fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)


def wait_for(process, condition, limit=20.0):
    """Looks again and again, without a pause, until the condition holds or the process has ended."""
    end = time.monotonic() + limit
    while not condition() and process.poll() is None:
        assert time.monotonic() < end, "it does not come about"


def stage_begins(process, stage):
    """Reads JSON lines until the stage has begun; returns what was read."""
    seen = []
    for line in process.stderr:
        seen.append(line)
        if json.loads(line).get("stage") == stage:
            break
    return "".join(seen)


@contextlib.contextmanager
def disk(folder, size, *targets):
    """A folder on a file system of its own, of so many bytes, with old files in it."""
    small = Folder(folder.path / "disk", folder.scene, targets or TARGETS)
    small.whole = folder.whole
    if os.geteuid() or subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", small.path], capture_output=True).returncode:
        pytest.skip("mounting a file system takes root, and leave to do so")
    try:
        small.set_up(old=True)
        yield small
    finally:
        subprocess.run(["umount", small.path], check=True)


def finish(process, *codes):
    """Waits for the end, which must be with one of the exit codes (0, if none is given); returns what was said."""
    _, err = process.communicate(timeout=60)
    assert process.returncode in (codes or (0,)), (process.returncode, err)
    return err or ""


def kill(process, by=signal.SIGKILL):
    """Sends a signal and waits; returns the exit code and what it said."""
    process.send_signal(by)
    _, err = process.communicate(timeout=30)
    return process.returncode, err or ""
