"""The command's manners: refusals, interruption, repeatability, what goes to which stream."""
import json
import os
import random
import shutil
import signal
import subprocess

import pytest

import gltf
import report as schema
import vdbinfo
from layouts import FAST, three_balls

MEDIUM = {"sigma_s": 3.0, "sigma_a": 0.0, "g": 0.5}


@pytest.fixture(scope="module")
def layout(tmp_path_factory):
    return three_balls(tmp_path_factory.mktemp("layout") / "three.glb")


# ---------------------------------------------------------------------------------------------------- bad inputs

def good(path):
    return gltf.scene(path, gltf.ball("Puff", **MEDIUM))


def text(path, content):
    path.write_text(content)
    return path


def extras(path, **fields):
    return gltf.scene(path, {"name": "Puff", "translation": [0, 0, 0], "extras": {"cloudvdb": fields}})


def medium(path, **fields):
    return gltf.scene(path, gltf.ball("Puff", **{**MEDIUM, **fields}))


def patched(path, change):
    document, blob = gltf.document([gltf.ball("Puff", **MEDIUM)])
    change(document)
    return gltf.write(path, document, blob)


def buffer_at(path, uri):
    good(path)
    document = json.loads(path.read_text())
    document["buffers"][0]["uri"] = uri
    return text(path, json.dumps(document))


def raw_nan(path):
    """JSON has no NaN, but writers emit it."""
    document, blob = gltf.document([gltf.ball("Puff", **MEDIUM)])
    document["nodes"][0]["translation"] = ["@", 0, 0]
    gltf.write(path, document, blob)
    return text(path, path.read_text().replace('"@"', "NaN"))


def huge(path):
    document, blob = gltf.document([gltf.ball("Puff", **MEDIUM)])
    document["nodes"][0]["translation"] = ["@", 0, 0]
    gltf.write(path, document, blob)
    return text(path, path.read_text().replace('"@"', "1e999"))


# name: (file, what makes it or None, words that stderr must have)
INPUTS = {
    "missing file": ("nowhere.glb", None, ["nowhere.glb"]),
    "a text file": ("notes.glb", lambda p: text(p, "hello, this is no glTF"), ["notes.glb", "gltf"]),
    "an empty file": ("empty.glb", lambda p: text(p, ""), ["empty.glb"]),
    "not JSON": ("broken.gltf", lambda p: text(p, '{"asset": {"version": "2.0"'), ["broken.gltf"]),
    "JSON but no glTF": ("list.gltf", lambda p: text(p, "[1, 2, 3]"), ["list.gltf"]),
    "a directory": ("folder.glb", lambda p: p.mkdir() or p, ["folder.glb", ("directory", "folder")]),
    "unknown extension": ("cloud.fbx", lambda p: text(p, "x"), ["cloud.fbx", ".glb"]),
    "missing buffer": ("lost.gltf", lambda p: buffer_at(p, "gone.bin"), ["lost.gltf", "gone.bin"]),
    "a buffer outside the folder": ("out.gltf", lambda p: buffer_at(p, "../../etc/passwd"), ["out.gltf", "passwd"]),
    "glTF 1.0": ("old.gltf", lambda p: patched(p, lambda d: d["asset"].update(version="1.0")), ["old.gltf"]),
    "index out of range": ("index.gltf", lambda p: patched(p, lambda d: d["nodes"][0].update(mesh=99)), ["index.gltf"]),
    "accessor beyond its buffer": ("beyond.gltf", lambda p: patched(p, lambda d: d["accessors"][0].update(count=100000)), ["beyond.gltf"]),
    "no scene content": ("bare.gltf", lambda p: text(p, '{"asset": {"version": "2.0"}}'), ["bare.gltf", "region"]),
    "required extension": ("needs.gltf", lambda p: patched(p, lambda d: d.update(extensionsRequired=["ACME_teapot"], extensionsUsed=["ACME_teapot"])),
                           ["needs.gltf", "ACME_teapot"]),
    "zero radius": ("zero.gltf", lambda p: extras(p, shape="sphere", radius=0.0, **MEDIUM), ["zero.gltf", "Puff", "radius"]),
    "negative radius": ("negative.gltf", lambda p: extras(p, shape="sphere", radius=-1.0, **MEDIUM), ["negative.gltf", "Puff", "radius"]),
    "unknown shape": ("shape.gltf", lambda p: extras(p, shape="teapot", **MEDIUM), ["shape.gltf", "Puff", "teapot", "sphere"]),
    "radius is text": ("words.gltf", lambda p: extras(p, shape="sphere", radius="big"), ["words.gltf", "Puff", "radius"]),
    "scale zero": ("flat.gltf", lambda p: patched(p, lambda d: d["nodes"][0].update(scale=[0, 0, 0])), ["flat.gltf", "Puff", "scale"]),
    "g of 1.5": ("g.gltf", lambda p: medium(p, g=1.5), ["g.gltf", "Puff", "1.5"]),
    "negative sigma": ("sigma.gltf", lambda p: medium(p, sigma_s=-1.0), ["sigma.gltf", "Puff", "sigma_s", "-1"]),
    "unknown preset": ("preset.gltf", lambda p: extras(p, shape="sphere", radius=1.0, preset="custard"), ["preset.gltf", "Puff", "custard", "cumulus"]),
    "medium of nothing": ("void.gltf", lambda p: medium(p, sigma_s=0.0), [("sigma", "medium", "scatter", "optical")]),
    "NaN in a transform": ("nan.gltf", raw_nan, ["nan.gltf"]),
    "infinity in a transform": ("inf.gltf", huge, ["inf.gltf"]),
}


@pytest.mark.parametrize("name", INPUTS)
def test_bad_input(cloudvdb, tmp_path, name):
    file, make, says = INPUTS[name]
    target = tmp_path / "target"
    target.mkdir()
    if make:
        make(tmp_path / file)
    cloudvdb.refuse(tmp_path / file, "-o", target / "out.vdb", "-o", target / "out.json", says=says, folder=target)


@pytest.mark.parametrize("part", [0.0, 0.001, 0.005, 0.02, 0.1, 0.3, 0.5, 0.9, 0.999])
def test_truncated_glb(cloudvdb, tmp_path, part):
    whole = good(tmp_path / "whole.glb").read_bytes()
    (tmp_path / "cut.glb").write_bytes(whole[:int(len(whole) * part)])
    target = tmp_path / "target"
    target.mkdir()
    cloudvdb.refuse(tmp_path / "cut.glb", "-o", target / "out.vdb", says=["cut.glb"], folder=target)


def test_random_damage_never_panics(cloudvdb, tmp_path):
    """Bytes changed at random: any answer but a panic, a hang or half a file."""
    whole = good(tmp_path / "whole.glb").read_bytes()
    rng = random.Random(5)
    target = tmp_path / "target"
    target.mkdir()
    for _ in range(25):
        damaged = bytearray(whole)
        for _ in range(rng.choice([1, 3, 20])):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        (tmp_path / "damaged.glb").write_bytes(damaged)
        ran = cloudvdb.run(tmp_path / "damaged.glb", "--density", "source", "--max-voxels", "200000", "-o", target / "out.vdb", "--overwrite", timeout=20)
        assert ran.code in (0, 1), ran
        assert ran.code == 1 or vdbinfo.read(target / "out.vdb")["grids"]["density"]["nonfinite"] == 0
        assert {p.name for p in target.iterdir()} <= {"out.vdb"}


# ---------------------------------------------------------------------------------------------------- bad targets

def test_a_medium_too_thin_for_the_duality(cloudvdb, tmp_path):
    """Light that never scatters twice leaves no photons to make regions of."""
    scene = gltf.scene(tmp_path / "thin.glb", gltf.ball("Puff", sigma_s=1e-7, sigma_a=0.0, g=0.5))
    target = tmp_path / "target"
    target.mkdir()
    cloudvdb.refuse(scene, *FAST, "-o", target / "out.vdb", says=[("photon", "scatter", "optical depth", "thin")], folder=target)


def test_too_few_voxels_allowed(cloudvdb, layout, tmp_path):
    """An explicit voxel size that the limit forbids: refused, with the size that would fit."""
    ran = cloudvdb.refuse(layout, "--density", "source", "--voxel-size", "0.01", "--max-voxels", "1000", "-o", tmp_path / "out.vdb",
                          says=["voxel", "0.01", "1000"], folder=tmp_path)
    sizes = [float(word.strip(",.;:()")) for word in ran.err.replace("m ", " ").split() if word.strip(",.;:()").replace(".", "", 1).isdigit()]
    assert any(size > 0.05 for size in sizes if size < 10), f"the size that would fit is missing\n{ran}"


def test_folder_of_the_target_is_missing(cloudvdb, layout, tmp_path):
    cloudvdb.refuse(layout, "-o", tmp_path / "no" / "where" / "out.vdb", says=["out.vdb", ("folder", "directory")], folder=tmp_path)


def test_target_is_a_folder(cloudvdb, layout, tmp_path):
    (tmp_path / "out.vdb").mkdir()
    cloudvdb.refuse(layout, "-o", tmp_path / "out.vdb", "--overwrite", says=["out.vdb", ("folder", "directory")], folder=tmp_path)


def test_existing_target_is_kept(cloudvdb, layout, tmp_path):
    target = text(tmp_path / "out.vdb", "precious")
    cloudvdb.refuse(layout, *FAST, "-o", target, says=["out.vdb", "--overwrite"], folder=tmp_path)
    assert target.read_text() == "precious"
    cloudvdb.succeed(layout, *FAST, "--density", "source", "-o", target, "--overwrite")
    assert target.read_bytes() != b"precious"
    assert [p.name for p in tmp_path.iterdir()] == ["out.vdb"]


def test_refusals_come_before_the_work(cloudvdb, layout, tmp_path):
    """Nobody waits an hour to hear that the target exists."""
    text(tmp_path / "b.json", "precious")
    ran = cloudvdb.refuse(layout, "--photons", "100000000", "-o", tmp_path / "a.vdb", "-o", tmp_path / "b.json", says=["b.json"], folder=tmp_path, timeout=30)
    assert ran.seconds < 2.0


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_unwritable_folder(cloudvdb, layout, tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    cloudvdb.refuse(layout, "-o", closed / "out.vdb", says=["out.vdb", "permission"], folder=closed)


def test_unwritable_filesystem(cloudvdb, layout):
    """Nobody, not even root, makes files in /proc."""
    cloudvdb.refuse(layout, "--density", "source", "-o", "/proc/out.vdb", says=["/proc"])


@pytest.fixture
def tiny_disk(tmp_path):
    """A file system of 8 kB."""
    place = tmp_path / "tiny"
    place.mkdir()
    if os.geteuid() or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8k", "tmpfs", place], capture_output=True).returncode:
        pytest.skip("mounting a file system takes root")
    yield place
    subprocess.run(["umount", place], check=True)


@pytest.mark.parametrize("name", ["out.vdb", "regions.glb"])
def test_disk_full(cloudvdb, scenes, tiny_disk, name):
    cloudvdb.refuse(scenes / "two_spheres.gltf", "--photons", "100000", "--estimate", "20", "--float32", "-o", tiny_disk / name,
                    says=[name, ("space", "full")], folder=tiny_disk)


USAGE = {
    "no arguments": [],
    "unknown option": ["LAYOUT", "-o", "out.vdb", "--frobnicate"],
    "unknown extension": ["LAYOUT", "-o", "out.xyz"],
    "no extension": ["LAYOUT", "-o", "out"],
    "no target": ["LAYOUT"],
    "the same target twice": ["LAYOUT", "-o", "out.vdb", "-o", "out.vdb"],
    "unknown density": ["LAYOUT", "-o", "out.vdb", "--density", "both"],
    "voxel size zero": ["LAYOUT", "-o", "out.vdb", "--voxel-size", "0"],
    "voxel size negative": ["LAYOUT", "-o", "out.vdb", "--voxel-size=-1"],
    "voxel size NaN": ["LAYOUT", "-o", "out.vdb", "--voxel-size", "nan"],
    "no photons": ["LAYOUT", "-o", "out.vdb", "--photons", "0"],
    "photons are words": ["LAYOUT", "-o", "out.vdb", "--photons", "many"],
    "up is x": ["LAYOUT", "-o", "out.vdb", "--up", "x"],
    "unknown grid": ["LAYOUT", "-o", "out.vdb", "--grids", "density,custard"],
    "completions for an unknown shell": ["completions", "klingon"],
    "a direction of zero": ["LAYOUT", "-o", "out.vdb", "--sun", "0,0,0"],
    "a direction of two numbers": ["LAYOUT", "-o", "out.vdb", "--sun", "-1,0"],
    "an angle of the sun beyond pi": ["LAYOUT", "-o", "out.vdb", "--sun-angle", "3.2"],
    "no extinction": ["LAYOUT", "-o", "out.vdb", "--sigma-t", "0"],
    "an albedo above 1": ["LAYOUT", "-o", "out.vdb", "--albedo", "0.5,0.5,1.5"],
    "a mean cosine of 1": ["LAYOUT", "-o", "out.vdb", "-g", "1"],
    "a negative irradiance": ["LAYOUT", "-o", "out.vdb", "--irradiance", "-3"],
    "a sky of NaN": ["LAYOUT", "-o", "out.vdb", "--sky", "nan"],
    "an angle of view of 180": ["LAYOUT", "-o", "out.png", "--fov", "180"],
    "a picture without pixels": ["LAYOUT", "-o", "out.png", "--size", "0x360"],
    "a picture too large": ["LAYOUT", "-o", "out.png", "--size", "20000x10"],
    "a picture of one side": ["LAYOUT", "-o", "out.png", "--size", "640"],
    "a camera of words": ["LAYOUT", "-o", "out.png", "--camera", "up,there,please"],
    "no samples": ["LAYOUT", "-o", "out.png", "--spp", "0"],
    "unknown integrator": ["LAYOUT", "-o", "out.png", "--integrator", "guess"],
    "periodic in z": ["LAYOUT", "-o", "out.vdb", "--periodic", "z"],
    "a grid of a layout": ["LAYOUT", "-o", "out.vdb", "--grid", "density"],
    "flux of nothing": ["flux"],
    "flux without photons": ["flux", "LAYOUT", "--photons", "0"],
    "flux without threads": ["flux", "LAYOUT", "--threads", "0"],
    "flux to a file": ["flux", "LAYOUT", "-o", "out.json"],
}


@pytest.mark.parametrize("name", USAGE)
def test_usage(cloudvdb, layout, tmp_path, name):
    arguments = [layout if a == "LAYOUT" else a for a in USAGE[name]]
    cloudvdb.refuse(*arguments, code=2, folder=tmp_path, cwd=tmp_path, timeout=20)


# ---------------------------------------------------------------------------------------------------- VDB files as scenes

@pytest.fixture(scope="module")
def cloud(layout, tmp_path_factory):
    """A VDB that the command itself wrote."""
    import command
    path = tmp_path_factory.mktemp("cloud") / "cloud.vdb"
    command.succeed(layout, "--density", "source", "-o", path, "-q")
    return path


def test_a_vdb_is_a_scene(cloudvdb, cloud, tmp_path):
    ran = cloudvdb.make(cloud, tmp_path)
    assert ran.became("region") == ["density"] and ran.became("sun") and ran.notes == []
    before, after = (vdbinfo.read(p)["grids"]["density"] for p in (cloud, tmp_path / "out.vdb"))
    assert after["integral"] * ran.density_scale == pytest.approx(before["integral"] * ran.density_scale, rel=5e-3)
    assert json.loads(cloudvdb.succeed("plan", cloud, "--json", "--periodic", "xy").out)["effects"]


def test_flags_override_the_file(cloudvdb, cloud, layout):
    """Values may begin with a minus sign."""
    for scene in (cloud, layout):
        absorbing = json.loads(cloudvdb.succeed("plan", scene, "--json", "--albedo", "0.25", "-g", "-0.3", "--sun", "-1,0,-1").out)
        figures = {name: figure for name, (_, _, figure) in schema.effects(absorbing).items()}
        assert figures["absorption"] == pytest.approx(0.75) and figures["anisotropy"] == pytest.approx(0.3)


def test_dry_run_of_a_picture(cloudvdb, cloud, layout, tmp_path):
    for scene in (cloud, layout):
        cloudvdb.succeed(scene, "-o", tmp_path / "out.png", "-o", tmp_path / "out.exr", "--dry-run", "--size", "64x48")
    assert list(tmp_path.iterdir()) == []


def test_what_a_vdb_cannot_do(cloudvdb, cloud, layout, tmp_path):
    for arguments, says in [
        ((cloud, "-o", tmp_path / "out.glb"), ["out.glb", ".vdb"]),
        ((cloud, "-o", tmp_path / "out.glb", "--density", "duality"), ["out.glb", ".vdb"]),
        ((cloud, "-o", tmp_path / "out.png", "--density", "duality", "--integrator", "photon", "--model", "hura2006"), ["voxel grid", "--model physical"]),
        ((cloud, "-o", tmp_path / "out.vdb", "--regions", "*"), ["--regions", "--grid"]),
    ]:
        cloudvdb.refuse(*arguments, code=2, says=says, folder=tmp_path)
    cloudvdb.refuse(cloud, "-o", tmp_path / "out.vdb", "--grid", "smoke", says=["cloud.vdb", "smoke", "density"], folder=tmp_path)
    cloudvdb.refuse(layout, "-o", tmp_path / "out.glb", "--periodic", "xy", code=2, says=["out.glb", ".vdb"], folder=tmp_path)
    text(tmp_path / "words.vdb", "hello, this is no VDB")
    for words in ("words.vdb", "nowhere.vdb"):
        for command in ((), ("plan",), ("flux",)):
            out = () if command else ("--json",)
            cloudvdb.refuse(*command, tmp_path / words, *out, says=[words], folder=tmp_path)


def test_a_damaged_vdb_never_panics(cloudvdb, cloud, tmp_path):
    whole = cloud.read_bytes()
    for part in (0.0, 0.01, 0.1, 0.5, 0.9, 0.999):
        (tmp_path / "cut.vdb").write_bytes(whole[:int(len(whole) * part)])
        cloudvdb.refuse(tmp_path / "cut.vdb", "--json", "--dry-run", says=["cut.vdb"], folder=tmp_path)


# ---------------------------------------------------------------------------------------------------- interruption

LONG = ("--photons", "30000000")


def test_interrupted(cloudvdb, scenes, tmp_path):
    """Ctrl-C at random times: it ends at once, with 130, and leaves nothing."""
    rng = random.Random(130)
    waits, late = [], 0
    for after in [0.05, 0.2] + [rng.uniform(0.1, 3.0) for _ in range(6)]:
        ended = cloudvdb.interrupt(scenes / "cumulus.gltf", *LONG, "-o", tmp_path / "out.vdb", "-o", tmp_path / "out.json", after=after)
        assert ended is not None, f"a job of 30 million photons was done within {after:.1f} s"
        code, wait, err = ended
        waits.append(wait)
        # Before it has begun to run it is the system that ends it; a shell calls that 130 too.
        assert code == 130 or (code == -signal.SIGINT and after < 0.1), (after, code, err)
        assert wait < 1.0, f"it took {wait:.2f} s to stop after {after:.2f} s"
        assert "panicked" not in err
        assert list(tmp_path.iterdir()) == [], (after, list(tmp_path.iterdir()))
    print("seconds from SIGINT to the end:", " ".join(f"{w:.3f}" for w in waits))


def test_interrupted_keeps_the_older_file(cloudvdb, scenes, tmp_path):
    text(tmp_path / "out.vdb", "precious")
    code, wait, _ = cloudvdb.interrupt(scenes / "cumulus.gltf", *LONG, "-o", tmp_path / "out.vdb", "--overwrite", after=1.0)
    assert code == 130 and wait < 1.0
    assert (tmp_path / "out.vdb").read_text() == "precious" and len(list(tmp_path.iterdir())) == 1


def test_terminated(cloudvdb, scenes, tmp_path):
    """SIGTERM, what a farm sends, leaves nothing behind either."""
    code, wait, _ = cloudvdb.interrupt(scenes / "cumulus.gltf", *LONG, "-o", tmp_path / "out.vdb", after=1.0, by=signal.SIGTERM)
    assert code in (130, 143, -signal.SIGTERM) and wait < 1.0
    assert list(tmp_path.iterdir()) == []


def test_interrupted_while_writing_voxels(cloudvdb, scenes, tmp_path):
    """The grids take their time too: a fine source needs no photons."""
    job = (scenes / "cumulus.gltf", "--density", "source", "--voxel-size", "2.2", "--max-voxels", "200000000", "-o", tmp_path / "out.vdb")
    for after in (0.1, 0.4, 1.0):
        ended = cloudvdb.interrupt(*job, "--progress", "json", after=after, alive=True)
        if ended is None:
            (tmp_path / "out.vdb").unlink()
            continue
        code, wait, err = ended
        print(f"SIGINT after {after} s: {wait:.3f} s to the end")
        assert code == 130 and wait < 1.0, (after, code, wait, err)
        assert list(tmp_path.iterdir()) == []


# ---------------------------------------------------------------------------------------------------- repeatability

@pytest.mark.parametrize("threads", [(1, 3), pytest.param((1, 2, 2, 3, 8), marks=pytest.mark.long)], ids=["few", "all"])
@pytest.mark.parametrize("options", [
    ("--integrator", "path", "--density", "duality"),
    ("--integrator", "photon", "--gather", "march"),
    ("--integrator", "photon", "--gather", "beam"),
    ("--integrator", "grid", "--bake", "view", "--no-check"),
    ("--integrator", "grid", "--atmosphere", "clear:visibility=2000"),
    pytest.param(("--integrator", "path", "--density", "source", "--bake", "sh1"), marks=pytest.mark.long),
    pytest.param(("--integrator", "path", "--atmosphere", "clear:visibility=2000"), marks=pytest.mark.long),
    pytest.param(("--integrator", "grid", "--bake", "sh2"), marks=pytest.mark.long),
], ids=lambda options: "-".join(o.lstrip("-") for o in options))
def test_threads_change_nothing(cloudvdb, layout, tmp_path, options, threads):
    """Each integrator, every kind of output, air and baked light."""
    outputs, written = ("out.vdb", "regions.glb", "out.exr", "out.png"), []
    for number, count in enumerate(threads):
        folder = tmp_path / str(number)
        folder.mkdir()
        report = cloudvdb.make(layout, folder, *FAST, *options, "--size", "24x18", "--spp", "2", "--max-voxels", "20k", "--threads", count,
                               outputs=outputs)
        told = json.dumps(schema.stable(report.data), sort_keys=True).replace(str(folder), "")
        written.append(([(folder / output).read_bytes() for output in outputs], told))
    (files, told), *others = written
    for count, (theirs, report) in zip(threads[1:], others):
        for name, a, b in zip(outputs, files, theirs):
            assert differing(a, b) == [], f"{name} differs with {count} threads"
        assert told == report, count


def differing(a, b):
    """Where two files differ, the first ten places. Bytes 21 to 56 are a UUID, which OpenVDB alone would draw at random."""
    if len(a) != len(b):
        return [("length", len(a), len(b))]
    return [i for i, (x, y) in enumerate(zip(a, b)) if x != y][:10]


def test_the_seed_matters(cloudvdb, layout, tmp_path):
    written = []
    for seed in ("1", "2"):
        cloudvdb.succeed(layout, "--photons", "20000", "--estimate", "100", "--seed", seed, "-o", tmp_path / f"{seed}.glb")
        written.append((tmp_path / f"{seed}.glb").read_bytes())
    assert written[0] != written[1]


# ---------------------------------------------------------------------------------------------------- manners

def test_dry_run_writes_nothing(cloudvdb, layout, tmp_path):
    ran = cloudvdb.succeed(layout, *FAST, "-o", tmp_path / "out.vdb", "-o", tmp_path / "out.json", "--dry-run")
    assert list(tmp_path.iterdir()) == []
    assert ran.out.strip() or ran.err.strip()
    assert ran.seconds < 5


def test_progress_is_json_lines(cloudvdb, layout, tmp_path):
    ran = cloudvdb.succeed(layout, *FAST, "-o", tmp_path / "out.vdb", "--progress", "json")
    lines = [json.loads(line) for line in ran.err.splitlines()]
    assert lines and all(isinstance(line, dict) for line in lines)


def test_refusal_is_json_too(cloudvdb, tmp_path):
    ran = cloudvdb.run(tmp_path / "nowhere.glb", "-o", tmp_path / "out.vdb", "--progress", "json")
    assert ran.code == 1
    lines = [json.loads(line) for line in ran.err.splitlines()]
    assert "nowhere.glb" in json.dumps(lines[-1])


def test_quiet(cloudvdb, layout, tmp_path):
    ran = cloudvdb.succeed(layout, *FAST, "-o", tmp_path / "out.vdb", "-q")
    assert ran.err == "" and ran.out == "", ran


def test_quiet_still_says_why_it_failed(cloudvdb, tmp_path):
    ran = cloudvdb.run(tmp_path / "nowhere.glb", "-o", tmp_path / "out.vdb", "-q")
    assert ran.code == 1 and "nowhere.glb" in ran.err


def test_streams_are_no_terminal(cloudvdb, layout, tmp_path):
    """No escape sequences and no carriage returns where nobody looks."""
    ran = cloudvdb.succeed(layout, *FAST, "-o", tmp_path / "out.vdb", "-v")
    assert "\x1b" not in ran.out + ran.err and "\r" not in ran.out + ran.err, ran


def test_paths_with_spaces_and_letters(cloudvdb, tmp_path):
    folder = tmp_path / "eine Wolke \u00fc \u96f2"
    folder.mkdir()
    scene = good(folder / "l\u00e4yout file.glb")
    cloudvdb.succeed(scene, "--density", "source", "-o", folder / "out put.vdb")
    assert "density" in vdbinfo.read(folder / "out put.vdb")["grids"]


def test_relative_paths(cloudvdb, tmp_path):
    good(tmp_path / "in.glb")
    cloudvdb.succeed("in.glb", "--density", "source", "-o", "out.vdb", cwd=tmp_path)
    assert (tmp_path / "out.vdb").is_file()


def test_plan(cloudvdb, scenes):
    ran = cloudvdb.succeed("plan", scenes / "cumulus.gltf", "--json")
    effects = schema.effects(json.loads(ran.out))
    assert any(on for on, _, _ in effects.values()) and any(not on for on, _, _ in effects.values())
    for name, (_, reason, figure) in effects.items():
        assert reason and figure is not None, (name, reason, figure)
    readable = cloudvdb.succeed("plan", scenes / "cumulus.gltf").out
    assert all(name.split("_")[0].split("-")[0].lower() in readable.lower() for name in effects), readable


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completions(cloudvdb, shell, tmp_path):
    script = cloudvdb.succeed("completions", shell).out
    assert "cloudvdb" in script and "voxel-size" in script
    if shutil.which(shell):
        (tmp_path / "script").write_text(script)
        assert subprocess.run([shell, "-n", tmp_path / "script"]).returncode == 0


def test_manual_page(cloudvdb):
    page = cloudvdb.succeed("man").out
    assert page.lstrip().startswith((".ie", ".TH", ".\\\"")) and ".SH" in page and "voxel" in page


def test_help_and_version(cloudvdb):
    for flag in ("-h", "--help"):
        ran = cloudvdb.succeed(flag)
        assert "Usage" in ran.out and "-o" in ran.out
    assert cloudvdb.succeed("--version").out.startswith("cloudvdb ")


def test_a_closed_pipe_is_no_panic(cloudvdb):
    """`cloudvdb man | head -1`."""
    line = f"'{cloudvdb.binary()}' man | head -c 10 >/dev/null; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True)
    assert "panicked" not in done.stderr and int(done.stdout) in (0, 1, 141), done
