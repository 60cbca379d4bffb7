"""VDBs that are cut, bent or lie, and layouts of absurd size: an answer or a sentence, in bounded time and memory, never a signal.

Each file goes through `doctor` and through the main job, under a limit of memory as `ulimit -v` sets it."""
import collections
import json
import random
import struct
import subprocess
import zlib

import pytest

import command
import vdbraw
from faults import limited

MEMORY = 2 << 30
WAYS = {"doctor": ("doctor", "IN"), "main job": ("IN", "-o", "OUT", "--overwrite", "-q", "--photons", "1k", "--max-voxels", "20k", "--estimate", "20", "--threads", "2")}
FILES = {
    "zip": vdbraw.vdb(vdbraw.ZIP | vdbraw.MASK),
    "zip, all values": vdbraw.vdb(vdbraw.ZIP),
    "plain": vdbraw.vdb(vdbraw.MASK),
    "blosc": None,  # by the command itself
}


@pytest.fixture(scope="module")
def files(cloudvdb, scenes, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "blosc.vdb"
    cloudvdb.succeed(scenes / "two_spheres.gltf", "-o", path, "--density", "source", "--max-voxels", "400", "-q")
    return dict(FILES, blosc=path.read_bytes())


def ends(data, folder, timeout=60):
    """The exit codes of each way, and what they said; whatever else happens fails the test."""
    path, codes = folder / "hostile.vdb", []
    path.write_bytes(data)
    for way in WAYS.values():
        line = [str({"IN": path, "OUT": folder / "out.vdb"}.get(word, word)) for word in way]
        done = subprocess.run([command.binary(), *line], capture_output=True, timeout=timeout, text=True,
                              env=command.environment(), preexec_fn=limited(AS=MEMORY))
        assert done.returncode in (0, 1, 2) and "panicked" not in done.stderr, done
        assert done.returncode == 0 or way[0] == "doctor" or len(done.stderr.splitlines()) == 1 and done.stderr.startswith("cloudvdb: "), done
        codes.append((done.returncode, done.stdout + done.stderr))
    assert {p.name for p in folder.iterdir()} <= {"hostile.vdb", "out.vdb"}
    return codes


@pytest.mark.parametrize("kind", FILES)
@pytest.mark.parametrize("step", [None, pytest.param(3, marks=pytest.mark.long)], ids=["few", "every third length"])
def test_cut(files, tmp_path, kind, step):
    whole = files[kind]
    assert [code for code, _ in ends(whole, tmp_path)] == [0, 0]
    for length in [*range(0, len(whole), step if step == 3 else len(whole) // 6), len(whole) - 1]:
        assert [code for code, _ in ends(whole[:length], tmp_path)] == [1, 1], length


@pytest.mark.parametrize("kind", FILES)
@pytest.mark.parametrize("times", [4, pytest.param(1500, marks=pytest.mark.long)], ids=["few", "many"])
def test_bent_at_random(files, tmp_path, kind, times):
    rng, codes = random.Random(f"{kind} {times}"), collections.Counter()
    for _ in range(times):
        bent = bytearray(files[kind])
        for _ in range(rng.choice((1, 1, 2, 8))):
            at = rng.randrange(len(bent) - 8)
            change = rng.randrange(4)
            if change == 0:
                bent[at] ^= 1 << rng.randrange(8)
            elif change == 1:
                bent[at] = rng.randrange(256)
            elif change == 2:
                bent[at:at + 4] = b"\xff" * 4
            else:
                bent[at:at + 8] = struct.pack("<q", rng.choice((-1, 1)) * rng.randrange(1 << rng.randrange(1, 62)))
        codes.update(code for code, _ in ends(bytes(bent), tmp_path))
    print(f"\n{kind}: of {times} files, twice each, exit codes", dict(codes))
    assert codes[1] and codes[0] + codes[1] == 2 * times


def bomb():
    packed = zlib.compress(bytes(1 << 28), 9)
    return struct.pack("<q", len(packed)) + packed


LIES = {
    "tiles for 1.9 gigavoxels": (dict(upper_tiles=[(i, 1.0) for i in range(1, 900)]), "memory"),
    "tiles for more than any memory": (dict(upper_tiles=[(i, 1.0) for i in range(1, 1100)]), "voxels"),
    "a tile of 4096^3": (dict(root_tiles=[((4096, 0, 0), 1.0)]), "voxels"),
    "20,000 tiles of 4096^3": (dict(root_tiles=[((4096 * i, 0, 0), 1.0) for i in range(1, 20_000)]), "root"),
    "four billion tiles": (dict(counts=(0xFFFFFFFF, 1)), "root"),
    "four billion children": (dict(counts=(0, 0xFFFFFFFF)), "root"),
    "eight thousand children": (dict(counts=(0, 8000)), "truncated"),
    "a chunk of a terabyte": (dict(stored=struct.pack("<q", 1 << 40)), "truncated"),
    "a chunk of minus a terabyte": (dict(stored=struct.pack("<q", -(1 << 40))), "wrong size"),
    "a chunk that unpacks to 256 MB": (dict(stored=bomb()), "wrong size"),
    "samples that are not finite": (dict(leaves={0: {i: (float("nan"), float("inf"))[i % 2] for i in range(512)}}), "finite"),
    "voxels as thick as nothing is": (dict(leaves={0: {i: 1e30 if i % 2 else 1e-38 for i in range(512)}}, entries={"class": "fog volume", "density_scale": 1.0}), "optical depth"),
    "voxels of no size": (dict(voxel=1e-150), "transform"),
    "voxels larger than space": (dict(voxel=1e30), "transform"),
}


@pytest.mark.parametrize("lie", LIES)
def test_files_that_lie(cloudvdb, tmp_path, lie):
    written, words = LIES[lie]
    (_, doctor), (code, said) = ends(vdbraw.vdb(**written), tmp_path)
    assert code == 1 and words in said, said
    assert doctor


@pytest.mark.parametrize("sample", [1e-42, 1e-38, 3e38, -1.0], ids=str)
def test_samples_at_the_ends(cloudvdb, tmp_path, sample):
    """Denormal, tiny, huge and negative samples: what is written from them is finite and not negative, or refused in words."""
    leaf = {i: sample if i % 2 else 1.0 for i in range(512)}
    (code, _), (done, said) = ends(vdbraw.vdb(leaves={0: leaf}), tmp_path)
    assert code in (0, 1) and (done == 0 or "half" in said or "sample" in said), said
    if done == 0:
        values = json.loads(cloudvdb.run("doctor", tmp_path / "out.vdb", "--json").out)["grids"][0]["values"]
        assert values["nan"] == values["infinite"] == values["negative"] == 0, values


def test_a_layout_of_a_million_nodes(cloudvdb, tmp_path):
    """None of them a cloud: a sentence that counts them, and does not list them."""
    nodes = ",".join('{"name":"n"}' for _ in range(1_000_000))
    (tmp_path / "many.gltf").write_text('{"asset":{"version":"2.0"},"nodes":[' + nodes + "]}")
    ran = cloudvdb.refuse(tmp_path / "many.gltf", "-o", tmp_path / "out.vdb", says=["many.gltf"], preexec_fn=limited(AS=MEMORY), timeout=60)
    assert len(ran.err) < 5000, len(ran.err)
