"""Runs the command under test."""
import dataclasses
import os
import pathlib
import signal
import subprocess
import time

from report import Report

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = ROOT / "scenes"


def binary():
    return pathlib.Path(os.environ.get("CLOUDVDB", ROOT / "target" / "release" / "cloudvdb")).resolve()


@dataclasses.dataclass
class Ran:
    code: int
    out: str
    err: str
    seconds: float
    command: list

    def __str__(self):
        return f"{' '.join(self.command)}\nexit code {self.code} after {self.seconds:.2f} s\nstdout: {self.out[-2000:]}\nstderr: {self.err[-2000:]}"


def environment():
    # A report of a panic must be plain to see, and colours must not come in between.
    return dict(os.environ, NO_COLOR="1", RUST_BACKTRACE="0", LC_ALL="C.UTF-8")


def run(*arguments, cwd=None, timeout=120, **kwargs):
    """Runs the command to its end, whatever that is."""
    line = [str(binary()), *map(str, arguments)]
    begin = time.monotonic()
    done = subprocess.run(line, cwd=cwd, capture_output=True, stdin=subprocess.DEVNULL, env=environment(),
                          timeout=timeout, **kwargs)
    ran = Ran(done.returncode, done.stdout.decode("utf-8"), done.stderr.decode("utf-8"), time.monotonic() - begin, line)
    assert "panicked" not in ran.err, ran
    return ran


def succeed(*arguments, **kwargs):
    ran = run(*arguments, **kwargs)
    assert ran.code == 0, ran
    return ran


def make(scene, folder, *arguments, outputs=("out.vdb",), **kwargs):
    """Runs the main job into `folder`; returns the report."""
    folder = pathlib.Path(folder)
    targets = [folder / name for name in outputs] + [folder / "report.json"]
    ran = succeed(scene, *(part for target in targets for part in ("-o", target)), *arguments, **kwargs)
    for target in targets:
        assert target.is_file() and target.stat().st_size > 0, f"{target.name} was not written\n{ran}"
    report = Report(folder / "report.json")
    report.ran = ran
    return report


def refuse(*arguments, code=1, says=(), folder=None, **kwargs):
    """The command must refuse: in one sentence that has every word of `says`, and without writing into `folder`."""
    before = listing(folder)
    ran = run(*arguments, **kwargs)
    assert ran.code == code, ran
    for word in says:
        # A tuple is a choice.
        words = word if isinstance(word, tuple) else (word,)
        assert any(str(w).lower() in ran.err.lower() for w in words), f"stderr says none of {words}\n{ran}"
    if code == 1:
        complaint = [line for line in ran.err.splitlines() if line.strip()]
        assert len(complaint) == 1, f"one sentence is asked for\n{ran}"
    assert listing(folder) == before, f"files appeared or changed: {set(listing(folder)) ^ set(before)}\n{ran}"
    return ran


def listing(folder):
    """Every file below `folder`, hidden ones too, with size and time of change."""
    if folder is None:
        return None
    return sorted((str(p), p.lstat().st_size, p.lstat().st_mtime_ns) for p in pathlib.Path(folder).rglob("*")
                  if not p.is_dir())


def free_memory():
    """What the system says that programs may still take, bytes."""
    line, = [line for line in pathlib.Path("/proc/meminfo").read_text().splitlines() if line.startswith("MemAvailable:")]
    return 1024 * int(line.split()[1])


def interrupt(*arguments, after, by=signal.SIGINT, cwd=None, limit=30.0, alive=False):
    """Sends SIGINT (or another) `after` seconds from the start, or where it says something of itself (`--progress json`) from its first
    sign of life, `alive`. Returns (exit code, seconds from the signal to the end, stderr), or None if the job was done before."""
    process = subprocess.Popen([str(binary()), *map(str, arguments)], cwd=cwd, env=environment(), stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    try:
        if alive:
            os.read(process.stderr.fileno(), 1)
        try:
            process.communicate(timeout=after)
            return None
        except subprocess.TimeoutExpired:
            pass
        begin = time.monotonic()
        process.send_signal(by)
        _, err = process.communicate(timeout=limit)
        return process.returncode, time.monotonic() - begin, err.decode()
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
