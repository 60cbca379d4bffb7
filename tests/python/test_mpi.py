"""The same bytes on any number of ranks, and an end with a sentence whatever happens to one of them.

`make test-mpi` builds the command with the feature `mpi` and runs these; `make test FEATURES=mpi` those that are not marked `ranks`."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import time

import pytest

import command
import gltf
import mpi
import report as schema
from command import SCENES
from faults import stage_begins

needs_mpi = pytest.mark.skipif(mpi.why_not() is not None, reason=str(mpi.why_not()))

SMALL = ("--size", "48x32", "--max-voxels", "60k", "-q")
# What is run, and what it writes: every integrator, the duality, each way of baking, an error that is asked for.
JOBS = {
    "duality, grid, bake": (("--photons", "20k", "--spp", "4", "--bake", "isotropic", "--no-check"), ("a.vdb", "b.exr", "c.glb", "d.png")),
    "path": (("--density", "source", "--integrator", "path", "--spp", "16"), ("b.exr",)),
    "photon": (("--density", "source", "--integrator", "photon", "--spp", "4", "--photons", "40k"), ("b.exr",)),
    "letter": (("--model", "hura2006", "--integrator", "photon", "--spp", "2", "--photons", "40k"), ("b.exr",)),
    "error": (("--density", "source", "--error", "20%", "--sky", "0.2,0.3,0.5"), ("b.exr",)),
}
# Long enough to be disturbed, in every stage.
LONG = (SCENES / "cumulus.gltf", "--integrator", "path", "--spp", "3000", "--size", "96x72", "--photons", "300k", "--density", "source",
        "-o", "a.exr", "-o", "b.vdb", "--threads", "1")


def words(name, threads=None):
    flags, files = JOBS[name]
    outputs = [word for file in files for word in ("-o", file)]
    return [SCENES / "two_spheres.gltf", *flags, *SMALL, *outputs, *(["--threads", threads] if threads else [])]


def written(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What one process writes, without MPI."""
    known = {}

    def of(name):
        if name not in known:
            folder = tmp_path_factory.mktemp("alone")
            command.succeed(*words(name), cwd=folder)
            known[name] = written(folder)
            assert set(known[name]) == set(JOBS[name][1])
        return known[name]
    return of


@needs_mpi
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
@pytest.mark.parametrize("name", JOBS)
def test_any_number_of_ranks_writes_the_same_bytes(alone, tmp_path, name, ranks, threads):
    mpi.together(ranks, *words(name, threads), cwd=tmp_path)
    assert written(tmp_path) == alone(name)


@pytest.mark.ranks
@needs_mpi
def test_all_directions_and_the_check_of_a_bake_are_those_of_one_process(tmp_path):
    """Light by harmonics, its comparison with the path tracer, the sky's light in a group of its own: also what the report says of it."""
    job = [SCENES / "two_spheres.gltf", "--density", "source", "--photons", "10k", "--bake", "sh1", "--voxel-size", "0.5", "--sky", "0.2,0.3,0.5", *SMALL, "-o", "a.vdb",
           "--json"]
    known = command.succeed(*job, cwd=tmp_path)
    bytes_of_one = (tmp_path / "a.vdb").read_bytes()
    _, out, _ = mpi.together(3, *job, "--overwrite", cwd=tmp_path)
    assert json.loads(out)["bake"] == json.loads(known.out)["bake"]
    assert (tmp_path / "a.vdb").read_bytes() == bytes_of_one


@needs_mpi
def test_without_mpirun_the_same_binary_runs_alone(alone, tmp_path):
    mpi.run([mpi.binary(), *words("path")], cwd=tmp_path)
    assert written(tmp_path) == alone("path")


@pytest.mark.ranks
@needs_mpi
def test_balance_and_study_are_those_of_one_process(tmp_path):
    scene = SCENES / "two_spheres.gltf"

    def balance(text):
        return {key: value for key, value in json.loads(text).items() if key != "seconds"}
    flux = ("flux", scene, "--photons", "300k", "--json", "-q")
    known = balance(command.succeed(*flux).out)
    for ranks in (2, 3):
        assert balance(mpi.together(ranks, *flux)[1]) == known
    study = ("study", scene, "--quick", "--size", "16x8", "--reference", "8", "-q", "-o")
    command.succeed(*study, tmp_path / "one")
    mpi.together(3, *study, tmp_path / "three")
    pictures = {path.name: path.read_bytes() for path in (tmp_path / "one" / "pictures").iterdir()}
    assert pictures and pictures == {path.name: path.read_bytes() for path in (tmp_path / "three" / "pictures").iterdir()}
    assert (tmp_path / "three" / "index.html").is_file()
    # What is there is not made again: no rank takes a picture on its own.
    lines = (tmp_path / "three" / "runs.jsonl").read_text()
    mpi.together(2, *study, tmp_path / "three")
    assert (tmp_path / "three" / "runs.jsonl").read_text() == lines


@pytest.mark.ranks
@needs_mpi
def test_a_study_of_the_duality_is_that_of_one_process(tmp_path):
    study = ("study", SCENES / "two_spheres.gltf", "--duality", "--quick", "--size", "16x8", "-q", "-o")
    same_study(tmp_path, study, ["duality.html", "duality.svg", "duality.png"], "duality.json")


@pytest.mark.ranks
@needs_mpi
def test_the_thesis_again_is_that_of_one_process(tmp_path):
    study = ("study", "--paper", SCENES / "hura2006_3.gltf", SCENES / "hura2006_1.gltf", "--tests", "3,1,savings", "--seeds", "2", "-q", "-o")
    pictures = ["test1.png", "test3.png", *(f"savings{n}_{side}.png" for n in (1, 3) for side in ("source", "duality"))]
    same_study(tmp_path, study, pictures, "study.json")


def timeless(figures):
    """Figures without what clocks and memory say, and what is computed of that."""
    report = json.loads(figures)
    for entry in report.get("savings", []):
        for side in ("source", "duality"):
            del entry[side]["seconds_at_equal"]
    return schema.stable(report)


def same_study(folder, study, files, figures):
    """The files that a study writes without clocks are the same on 1 to 4 ranks, and so are its figures but for seconds and memory."""
    command.succeed(*study, folder / "alone")
    known = written(folder / "alone")
    for ranks in (1, 2, 3, 4):
        mpi.together(ranks, *study, folder / f"of{ranks}")
        found = written(folder / f"of{ranks}")
        assert set(found) == set(known)
        assert all(found[name] == known[name] for name in files), ranks
        assert timeless(found[figures]) == timeless(known[figures]), ranks


@pytest.mark.ranks
@needs_mpi
def test_lamps_shine_alike_on_any_number_of_ranks(tmp_path):
    """Light of two lamps, one a spot, and of no sun: of paths, of photons left in voxels, and of photons stored."""
    document, blob = gltf.document([gltf.ball("Left", (-1.2, 0, 1), sigma_t=4, albedo=0.99, g=0.7), gltf.ball("Right", (1.2, 0, 1), sigma_t=4, albedo=0.9)],
                                   sun=False)
    blob = gltf.add_ground(document, blob)
    gltf.add_lamp(document, (0, -1.8, 2.2), 8.0)
    gltf.add_lamp(document, (-2.4, 1.0, 3.0), 6.0, type="spot", spot={"outerConeAngle": 1.0})
    scene = gltf.write(tmp_path / "lamps.gltf", document, blob)
    flags = {"path": ("--density", "source", "--spp", "16"), "grid": ("--photons", "30k", "--spp", "4", "-o", "a.vdb"),
             "photon": ("--photons", "30k", "--spp", "4")}
    for integrator, more in flags.items():
        job = [scene, "--integrator", integrator, *more, *SMALL, "-o", "b.exr"]
        known = alone_in(tmp_path / integrator, job)
        for ranks in (1, 2, 3, 4):
            folder = tmp_path / f"{integrator}{ranks}"
            folder.mkdir()
            mpi.together(ranks, *job, cwd=folder)
            assert written(folder) == known, (integrator, ranks)


def alone_in(folder, job):
    """What one process writes into a new folder, without MPI."""
    folder.mkdir()
    command.succeed(*job, cwd=folder)
    return written(folder)


@pytest.mark.ranks
@needs_mpi
def test_one_rank_speaks_and_counts_what_all_do(tmp_path):
    job = [SCENES / "two_spheres.gltf", "--density", "source", "--integrator", "path", "--spp", "400", "--size", "48x32", "-o", "b.exr"]
    _, out, err = mpi.together(3, *job, "--progress", "json", "--json", cwd=tmp_path)
    report = json.loads(out)
    assert report["together"]["ranks"] == 3 and report["together"]["bytes"] > 48 * 32 * 84
    events = [json.loads(text) for text in err.splitlines() if text.startswith("{")]
    assert [e["event"] for e in events].count("done") == 1
    shares = [e["fraction"] for e in events if e.get("stage") == "render"]
    assert shares == sorted(shares) and shares[-1] > 0.5


# ---------------------------------------------------------------------------------------------------- faults

@pytest.fixture
def own(tmp_path):
    """The command under a name of its own, so that its processes can be told from others'."""
    path = tmp_path / "bin" / "cloudvdb"
    path.parent.mkdir()
    shutil.copy(mpi.binary(), path)
    yield path
    for left in mpi.processes(path):
        os.kill(left, signal.SIGKILL)


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "out"
    path.mkdir()
    return path


def ends(process, own, folder, says, within=15.0, hidden=False):
    """The run must end with a code above 0 and a sentence, and leave nothing; but `hidden` files where no process could remove them."""
    begun = time.monotonic()
    try:
        _, err = process.communicate(timeout=within)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        pytest.fail(f"the run goes on: {process.communicate()[1]}")
    assert process.returncode not in (0, None), err
    assert any(text in err for text in says), err
    assert "panicked" not in err, err
    assert mpi.gone(own), f"left: {mpi.processes(own)} after {time.monotonic() - begun:.1f} s"
    left = [path.name for path in folder.iterdir() if not hidden or not path.name.endswith(".part")]
    assert left == []


def started(own, ranks, process, within=20.0):
    """Waits until all ranks run; gives their ids."""
    until = time.monotonic() + within
    while len(mpi.processes(own)) < ranks:
        assert time.monotonic() < until and process.poll() is None, process.communicate()[1]
        time.sleep(0.02)
    return mpi.processes(own)


@pytest.mark.ranks
@needs_mpi
@pytest.mark.parametrize("which", [0, 1, 2])
@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.parametrize("stage", ["import", "render"])
def test_a_rank_that_dies_ends_all(own, folder, which, by, stage):
    """Once all have met. Where one dies while Open MPI still connects them, it is up to mpirun: one in 48 of those waited for ever."""
    process = mpi.start(mpi.line((3, [own, *LONG, "--progress", "json"])), folder, bufsize=1)
    ids = started(own, 3, process)
    stage_begins(process, stage)
    os.kill(ids[which], by)
    ends(process, own, folder, ["exited on signal", "non-zero status", "interrupted"], hidden=which == 0 and by == signal.SIGKILL)


@pytest.mark.ranks
@needs_mpi
@pytest.mark.parametrize("after", [0.0, 0.3, 2.0])
def test_an_interrupted_run_ends_everywhere(own, folder, after):
    process = mpi.start(mpi.line((3, [own, *LONG])), folder)
    started(own, 3, process)
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    ends(process, own, folder, ["interrupted"] if after > 1 else [""])


@pytest.mark.ranks
@needs_mpi
def test_a_rank_of_another_build_is_refused(own, folder):
    other = own.with_name("other")
    other.write_bytes(own.read_bytes() + b"\0")
    other.chmod(0o755)
    process = mpi.start(mpi.line((2, [own, *LONG]), (1, [other, *LONG])), folder)
    ends(process, own, folder, ["1 of 3 ranks run another cloudvdb than rank 0"])
    assert mpi.gone(other)


@pytest.mark.ranks
@needs_mpi
def test_a_rank_with_another_scene_is_refused(own, folder):
    other = [SCENES / "two_spheres.gltf", *LONG[1:]]
    process = mpi.start(mpi.line((2, [own, *LONG]), (1, [own, *other])), folder)
    ends(process, own, folder, ["1 of 3 ranks read another scene, or were given other settings"])


@pytest.mark.ranks
@needs_mpi
def test_a_rank_without_the_scene_says_where(own, folder):
    other = ["missing.gltf", *LONG[1:]]
    process = mpi.start(mpi.line((2, [own, *LONG]), (1, [own, *other])), folder)
    ends(process, own, folder, ["rank 2 on"])


@pytest.mark.ranks
@needs_mpi
def test_a_rank_out_of_memory_ends_all(own, folder):
    # The limit falls once the rank is at work, below what it has.
    photons = [SCENES / "cumulus.gltf", "--integrator", "grid", "--photons", "20M", "--density", "source", "--memory", "8G",
               "--size", "640x480", "-o", "a.exr", "--threads", "1"]
    process = mpi.start(mpi.line((3, [own, *photons])), folder)
    ids = started(own, 3, process)
    time.sleep(2.0)
    subprocess.run(["prlimit", f"--pid={ids[1]}", "--as=200000000"], check=True)
    ends(process, own, folder, ["no more memory", "Free memory"], within=60.0)


@pytest.mark.ranks
@needs_mpi
def test_photons_beyond_memory_are_refused_before_any_is_traced(own, folder):
    flags = [SCENES / "cumulus.gltf", "-o", "a.vdb", "--threads", "1"]
    process = mpi.start(mpi.line((3, [own, *flags, "--photons", "50M", "--memory", "1G"])), folder)
    ends(process, own, folder, ["--photons 50000000 takes 2100.0 MB of memory"], within=10.0)
    # What one process would have memory for, and not all that share its host.
    fits = command.free_memory() // 42
    if fits > 4294967295:
        pytest.skip("there is memory for as many photons as can be asked for")
    process = mpi.start(mpi.line((3, [own, *flags, "--photons", fits // 2])), folder)
    ends(process, own, folder, ["for each of 3 ranks on this host. Use --photons"], within=10.0)


@needs_mpi
def test_what_all_refuse_is_said_once(own, folder):
    process = mpi.start(mpi.line((3, [own, "missing.gltf", "-o", "a.vdb"])), folder)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 1 and err.count("missing.gltf") == 1, err
    process = mpi.start(mpi.line((3, [own, "--nonsense"])), folder)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 2 and err.count("unexpected argument") == 1, err


# ---------------------------------------------------------------------------------------------------- checkpoints

PICTURES = {
    "path": ("--density", "source", "--integrator", "path", "--spp", "120"),
    "grid": ("--density", "source", "--integrator", "grid", "--photons", "150k", "--spp", "16"),
    "duality": ("--photons", "1M", "--max-voxels", "200k"),
}


def resumable(name, output, *more):
    return [SCENES / "cumulus.gltf", *PICTURES[name], "--size", "64x48", "--threads", "2", "-o", output, *more]


# Where each is stopped, start by start: a stage, and how much of it is done at least. What is over before the last counts as more than that.
STOPS = {
    "path": [("render", 0.2), ("render", 0.5)],
    "grid": [("photons", 0.3), ("smoothing", 0), ("render", 0)],
    "duality": [("photons", 0.2), ("photons", 0.6), ("regions", 0)],
}


def told(process, stage, share):
    """What the run says of its progress, until so much of a stage, or the next one, is reached: (stage, share) one by one."""
    said = []
    for line in process.stderr:
        event = json.loads(line)
        assert event["event"] == "progress", f"the run ended before {stage}: {said}"
        said.append((event["stage"], event["fraction"]))
        if (event["stage"] == stage and event["fraction"] >= share) or (stage, 0.0) in said[:-1] and event["stage"] != stage:
            return said
    raise AssertionError(f"the run ended before {stage}: {said}")


@pytest.mark.parametrize("name, by", [("path", signal.SIGINT), ("path", signal.SIGKILL), ("grid", signal.SIGKILL), ("duality", signal.SIGKILL)])
def test_a_run_goes_on_from_its_checkpoint_to_the_same_bytes(tmp_path, name, by):
    output, kept = "out.vdb" if name == "duality" else "out.exr", tmp_path / "run.checkpoint"
    command.succeed(*resumable(name, tmp_path / f"whole_{output}"))
    job = list(map(str, resumable(name, tmp_path / output, "--checkpoint", kept)))
    before = None
    for stage, share in STOPS[name]:
        process = subprocess.Popen([str(command.binary()), *job, "--progress", "json"], stdin=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   text=True, bufsize=1, env=command.environment())
        said = told(process, stage, share)
        process.send_signal(by)
        _, err = process.communicate(timeout=30)
        assert process.returncode != 0 and kept.exists() and not (tmp_path / output).exists(), err
        assert by == signal.SIGKILL or "goes on from" in err, err
        # It did go on: what items were done then, it begins with.
        again = next((done for at, done in said if at == stage and done > 0), 0)
        assert before is None or before[0] != stage or again >= before[1], (before, said)
        before = said[-1]
    command.succeed(*job)
    assert (tmp_path / output).read_bytes() == (tmp_path / f"whole_{output}").read_bytes()
    assert not kept.exists()


def test_the_checkpoint_of_another_run_is_refused(tmp_path):
    kept = tmp_path / "run.checkpoint"
    job = [SCENES / "cumulus.gltf", "--density", "source", "--integrator", "path", "--size", "96x72", "-o", tmp_path / "b.exr",
           "--checkpoint", kept]
    process = subprocess.Popen([str(command.binary()), *map(str, job), "--spp", "30000"],
                               stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until = time.monotonic() + 20
        while not kept.exists() and time.monotonic() < until:
            time.sleep(0.05)
        command.refuse(*job, "--spp", "30000", says=["run.checkpoint", "goes on right now"])
    finally:
        process.kill()
        process.wait()
    command.refuse(*job, "--spp", "30001", says=["run.checkpoint", "another run"])
    picture = tmp_path / "picture.exr"
    picture.write_bytes(b"not a checkpoint")
    command.refuse(*job[:-1], picture, "--spp", "3", says=["picture.exr", "is no checkpoint"])
    assert picture.read_bytes() == b"not a checkpoint"


@pytest.mark.ranks
@needs_mpi
def test_ranks_go_on_from_what_another_number_of_ranks_did(own, tmp_path, folder):
    whole = command.succeed(*resumable("path", tmp_path / "whole.exr"))
    words = resumable("path", folder / "out.exr", "--checkpoint", folder / "run.checkpoint")
    stops = 0
    for ranks in (1, 3, 2, 4):
        process = mpi.start(mpi.line((ranks, [own, *words])))
        ids = started(own, ranks, process)
        try:
            process.communicate(timeout=max(0.6, 0.3 * whole.seconds))
        except subprocess.TimeoutExpired:
            os.kill(ids[-1], signal.SIGKILL)
            process.communicate(timeout=20)
            stops += 1
        assert mpi.gone(own)
    assert stops > 0
    if not (folder / "out.exr").exists():
        mpi.run(mpi.line((2, [own, *words])))
    assert (folder / "out.exr").read_bytes() == (tmp_path / "whole.exr").read_bytes()
    assert not (folder / "run.checkpoint").exists()


# ---------------------------------------------------------------------------------------------------- hosts

@pytest.mark.ranks
@needs_mpi
def test_hosts_with_addresses_of_their_own(alone, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    try:
        with mpi.hosts(tmp_path) as flags:
            mpi.run(mpi.line((3, [mpi.binary(), *words("duality, grid, bake", 1)]), flags=flags), cwd=out)
            assert written(out) == alone("duality, grid, bake")
            _, _, err = mpi.run(mpi.line((2, [mpi.binary(), *LONG]), (1, [mpi.binary(), "missing.gltf", *LONG[1:]]), flags=flags),
                                cwd=pathlib.Path(tmp_path), code=None)
            assert "on cvdb" in err, err
    except (subprocess.CalledProcessError, FileNotFoundError, PermissionError) as e:
        pytest.skip(f"this machine makes no network namespaces ({e})")
