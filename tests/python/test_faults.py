"""Whatever ends a run, each target is the old file or the whole new one, and what can speak says why.

Signals at every moment, full disks, folders that take nothing, limits of memory and of files, streams that nobody reads, two runs
at once. `python -m pytest tests/python/test_faults.py -s` prints what was hit."""
import collections
import json
import os
import random
import shutil
import signal
import subprocess
import time

import pytest

import command
import faults
from faults import TARGETS, Folder, disk, finish, kill, limited, sentence, stage_begins, wait_for


@pytest.fixture(scope="module")
def learned(cloudvdb, scenes, tmp_path_factory):
    """A folder, and the seconds of a run in it."""
    folder = Folder(tmp_path_factory.mktemp("faults") / "clouds", scenes / "cumulus.gltf")
    folder.learn()
    return folder, folder.learn()


@pytest.fixture
def folder(learned):
    """The folder without a file in it."""
    folder, _ = learned
    shutil.rmtree(folder.path)
    folder.path.mkdir()
    return folder


# ---------------------------------------------------------------------------------------------------- killed

@pytest.mark.parametrize("moments", [30, pytest.param(200, marks=pytest.mark.long)])
def test_killed_at_random_moments(learned, folder, moments):
    """SIGKILL, two thirds at any time, one third when so many files are written or the first is renamed. What is left beside the
    targets are hidden files, in whose midst the next runs succeed."""
    rng, ends, (_, seconds) = random.Random(moments), collections.Counter(), learned
    for i in range(moments):
        old = rng.random() < 0.5
        folder.set_up(old)
        before = len(folder.left())
        process = folder.start(overwrite=old, stderr=subprocess.DEVNULL)
        if i % 3:
            time.sleep(rng.uniform(0.0, 1.1 * seconds))
        elif i % 6:
            written = before + rng.randint(1, len(TARGETS))
            wait_for(process, lambda: len(folder.left()) >= written)
        else:
            wait_for(process, folder.renaming)
        code, _ = kill(process)
        states = folder.states(old)
        assert code == -signal.SIGKILL or states == ["new"] * len(TARGETS), (i, code, states)
        ends["done" if code == 0 else "/".join(sorted(set(states)))] += 1
    left = folder.left()
    assert all(name for name in left if faults.PART.fullmatch(name).group(1) in TARGETS), left
    folder.set_up(old=True)
    folder.run(overwrite=True)
    assert folder.states(old=True) == ["new"] * len(TARGETS) and folder.left() == left
    print(f"\nof {moments} runs killed the targets were:", dict(ends), f"and {len(left)} temporary files were left")


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda by: by.name)
@pytest.mark.parametrize("stage", faults.STAGES)
def test_stopped_at_each_stage(folder, by, stage):
    old = by == signal.SIGTERM
    folder.set_up(old)
    process = folder.start("--progress", "json", overwrite=old, bufsize=1)
    stage_begins(process, stage)
    code, err = kill(process, by)
    assert code in (0, 130), (code, err)
    folder.check(code, err, old)
    if code:
        errors = [line for line in err.splitlines() if '"error"' in line]
        assert len(errors) == 1 and "interrupted; nothing was written" in errors[0] and "130" in errors[0], err


@pytest.mark.parametrize("moments", [8, pytest.param(200, marks=pytest.mark.long)])
def test_stopped_at_random_moments(learned, folder, moments):
    """SIGINT and SIGTERM: as SIGKILL, but nothing is left, and it is told once."""
    rng, ends, (_, seconds) = random.Random(moments), collections.Counter(), learned
    for i in range(moments):
        by, old = (signal.SIGINT, signal.SIGTERM)[i % 2], bool(i % 4 < 2)
        folder.set_up(old)
        process = folder.start("-q", overwrite=old)
        # From when signals are watched; before, the system ends what has not begun.
        time.sleep(rng.uniform(0.05, seconds))
        code, err = kill(process, by)
        assert code in (0, 130, -by), (code, err)
        late = "after the files were written" in err
        folder.check(code, err, old, late)
        if code == 130 and not late:
            sentence(err, "interrupted; nothing was written")
        ends[code, late] += 1
    print("\nexit codes:", dict(ends))


def test_stopped_after_the_files_were_written(folder):
    """The report on stdout waits for a reader, the files are in their places: it does not say that nothing was written."""
    reading, writing, _ = faults.narrow_pipe()
    process = folder.start("--json", "-q", stdout=writing)
    os.close(writing)
    wait_for(process, lambda: (folder.path / TARGETS[-1]).exists())
    time.sleep(0.1)
    code, err = kill(process, signal.SIGINT)
    os.close(reading)
    assert code == 130
    sentence(err, "interrupted after the files were written")
    folder.check(code, err, old=False, late=True)


def test_stopped_while_nobody_reads(folder):
    """The pipe of stderr is full, and stays so: a signal ends the run nevertheless."""
    reading, writing, room = faults.narrow_pipe()
    os.write(writing, b"." * room)
    process = folder.start("--progress", "json", stderr=writing)
    os.close(writing)
    time.sleep(0.3)
    process.send_signal(signal.SIGTERM)
    try:
        assert process.wait(timeout=3) == 130
    finally:
        process.kill()
        os.close(reading)
    folder.check(130, "", old=False)


# ---------------------------------------------------------------------------------------------------- disks and folders

@pytest.mark.parametrize("name", TARGETS[:5])
def test_disk_full(folder, name):
    with disk(folder, "4k", name) as small:
        err = small.run("-q", overwrite=True, code=1)
        sentence(err, name, "No space left", ("space", "room"))
        small.check(1, err, old=True)


@pytest.mark.parametrize("size", ["150k", "300k"])
def test_disk_full_before_the_last_file(folder, size):
    """The first files fit."""
    with disk(folder, size) as small:
        err = small.run("-q", overwrite=True, code=1)
        sentence(err, TARGETS, "No space left")
        small.check(1, err, old=True)


@pytest.mark.parametrize("name", TARGETS[:5])
@pytest.mark.parametrize("ignored", [False, True], ids=["SIGXFSZ", "EFBIG"])
def test_file_over_the_limit(folder, name, ignored):
    """The system sends SIGXFSZ, which ends whoever does not handle it; or fails the write, where the signal is ignored."""
    one = Folder(folder.path, folder.scene, (name,))
    one.set_up(old=True)

    def limit():
        limited(FSIZE=1024)()
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN if ignored else signal.SIG_DFL)

    err = one.run("-q", overwrite=True, code=1, preexec_fn=limit)
    sentence(err, name, "File too large")
    one.check(1, err, old=True)


@pytest.mark.parametrize("old", [False, True])
def test_read_only_folder(folder, old):
    """Root too may not write where nobody may."""
    with disk(folder, "1m") as small:
        small.set_up(old)
        subprocess.run(["mount", "-o", "remount,ro", small.path], check=True)
        err = small.run(overwrite=old, code=1)
        sentence(err, TARGETS[0], "Read-only", "permissions")
        small.check(1, err, old)


def test_a_target_that_cannot_be_replaced(folder):
    """What has been renamed before it is whole, the others are old."""
    fixed = folder.path / TARGETS[3]
    folder.set_up(old=True)
    if subprocess.run(["chattr", "+i", fixed], capture_output=True).returncode:
        pytest.skip("this file system, or this user, makes no file immutable")
    try:
        err = folder.run(overwrite=True, code=1)
    finally:
        subprocess.run(["chattr", "-i", fixed], check=True)
    sentence(err, TARGETS[3], "not permitted", "permissions")
    assert folder.states(old=True)[3] == "old" and folder.left() == []


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_target_becomes_a_folder(folder, overwrite):
    process = folder.start(overwrite=overwrite)
    wait_for(process, folder.writing)
    (folder.path / TARGETS[0]).mkdir()
    err = finish(process, 1)
    sentence(err, TARGETS[0], ("directory", "meanwhile"))
    (folder.path / TARGETS[0]).rmdir()
    folder.check(1, err, old=False)


def test_the_folder_disappears(folder):
    process = folder.start()
    wait_for(process, folder.writing)
    shutil.move(folder.path, folder.path.with_name("elsewhere"))
    shutil.rmtree(folder.path.with_name("elsewhere"))
    err = finish(process, 1)
    sentence(err, TARGETS)
    folder.path.mkdir()


# ---------------------------------------------------------------------------------------------------- two runs at once

def test_a_target_that_appears_meanwhile_is_kept(folder):
    """Without --overwrite nothing is replaced, whenever it came."""
    process = folder.start()
    wait_for(process, folder.writing)
    (folder.path / TARGETS[2]).write_text("theirs")
    err = finish(process, 1)
    sentence(err, TARGETS[2], "--overwrite")
    assert (folder.path / TARGETS[2]).read_text() == "theirs"
    assert [p.name for p in folder.path.iterdir()] == [TARGETS[2]]


def test_two_runs_on_one_target(folder):
    """One wins, all its files; the other says so."""
    runs = [folder.start(), folder.start()]
    ends = sorted((run.wait(timeout=30), run.stderr.read()) for run in runs)
    assert [code for code, _ in ends] == [0, 1], ends
    sentence(ends[1][1], TARGETS, "--overwrite")
    folder.check(0, "", old=False)


def test_two_runs_that_overwrite(folder):
    """Both are done; each file is of one of them."""
    folder.set_up(old=True)
    runs = [folder.start("--seed", seed, overwrite=True) for seed in (0, 1)]
    assert [run.wait(timeout=30) for run in runs] == [0, 0]
    other = Folder(folder.path.with_name("other"), folder.scene)
    other.learn("--seed", 1)
    for name in TARGETS:
        there = faults.content(name, (folder.path / name).read_bytes())
        assert there in (folder.whole[name], other.whole[name]), name
    assert folder.left() == []


# ---------------------------------------------------------------------------------------------------- memory and streams

@pytest.mark.parametrize("sizes", [(2, 6, 12, 20, 26, 34, 150, 220), pytest.param(tuple(range(2, 330, 3)), marks=pytest.mark.long)],
                         ids=["few", "many"])
def test_memory_limit(folder, sizes):
    """More than one way leads to less memory than is asked for: threads, Rust's allocations (which abort), OpenVDB's (which throw).
    All end with the reason in the last line. Rust's own words cannot be taken from the lines before."""
    least, ends = faults.least_memory(), collections.Counter()
    for i, more in enumerate(sizes):
        old = bool(i % 2)
        folder.set_up(old)
        manners = ("--progress", "json") if old else ("-q",)
        process = folder.start(*manners, overwrite=old, preexec_fn=limited(AS=(least + more) << 20))
        err, code = finish(process, 0, 1), process.returncode
        folder.check(code, err, old)
        if code:
            last = err.splitlines()[-1]
            told = json.loads(last)["message"] if old else last.removeprefix("cloudvdb: ")
            assert told != last and ("memory" in told or "Resource temporarily" in told), (more, err)
        ends[told[:60] if code else "done"] += 1
    print(f"\n{least} MB of address space and 2 to {sizes[-1]} more:", *ends.items(), sep="\n  ")
    assert len(ends) > 1, "no limit was too small, or none large enough"


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
@pytest.mark.parametrize("style", ["bar", "json"])
def test_nobody_reads(folder, stream, style):
    """A closed pipe is no reason to fail."""
    reading, writing = os.pipe()
    os.close(reading)
    process = folder.start("--json", "--progress", style, **{stream: writing})
    os.close(writing)
    folder.check(0, finish(process), old=False)


def test_no_streams_at_all(folder):
    """Files do not take the place of streams that are closed."""
    process = folder.start("--json", preexec_fn=lambda: os.closerange(0, 3), stderr=subprocess.DEVNULL)
    folder.check(0, finish(process), old=False)


@pytest.mark.parametrize("arguments", [("man",), ("completions", "bash"), ("plan", "SCENE"), ("flux", "SCENE", "--photons", "1k"), ("SCENE", "--json", "-q", "--photons", "20k")],
                         ids=lambda arguments: " ".join(arguments))
@pytest.mark.parametrize("place", ["/dev/full", "limit"])
def test_stdout_is_full(scenes, tmp_path, arguments, place):
    line = [command.binary(), *(scenes / "slab.gltf" if a == "SCENE" else a for a in arguments)]
    with open(place if place != "limit" else tmp_path / "out", "wb") as out:
        done = subprocess.run(line, stdout=out, stderr=subprocess.PIPE, text=True, preexec_fn=limited(FSIZE=100))
    assert done.returncode == 1, done
    sentence(done.stderr.splitlines()[-1], "stdout", "No space left" if place == "/dev/full" else "File too large")
