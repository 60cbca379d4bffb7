"""What else a VDB holds is written again as it is: OpenVDB's own Python module compares, value by value, state by state."""
import subprocess

import pytest

START = r"""
import sys
import numpy as np, pyopenvdb as vdb

def density(name="density"):
    made = vdb.FloatGrid()
    made.name, made.gridClass = name, vdb.GridClass.FOG_VOLUME
    made.transform = vdb.createLinearTransform(0.1)
    made.fill((0, 0, 0), (20, 20, 20), 1.0)
    return made

def filled(grid, name, cast, transform=None):
    # Noise in two leaves, tiles of every size, and values that are there but not active.
    grid.name = name
    random = np.random.default_rng(3)
    for index in np.ndindex(9, 5, 12):
        value = cast(random.integers(-40, 40, 3))
        grid.fill(index, index, value, bool(random.integers(0, 2)))
    grid.fill((16, 16, 16), (23, 23, 23), cast(np.array([3, 4, 5])))
    grid.fill((128, 0, 0), (255, 127, 127), cast(np.array([7, 0, -5])))
    grid.fill((-4096, 0, 0), (-1, 4095, 4095), cast(np.array([1, 2, 3])), False)
    if transform is not None:
        grid.transform = transform
    return grid

real = lambda v: float(v[0]) / 8
vector = lambda v: tuple(float(x) / 8 for x in v)
skewed = vdb.createLinearTransform([[0.1, 0, 0, 0], [0.02, 0.2, 0, 0], [0, 0.05, 0.3, 0], [5, -7, 9, 1]])
"""

MAKE = START + r"""
path, kind = sys.argv[1:]
others = []
if kind == "kinds":
    others += [filled(vdb.FloatGrid(0.25), "temperature", real, skewed), filled(vdb.BoolGrid(), "mask", lambda v: bool(v[0] > 0)),
               filled(vdb.Vec3SGrid((0.5, 0.0, -1.0)), "vel", vector)]
    ball = vdb.createLevelSetSphere(radius=4, voxelSize=0.5)
    ball.name = "surface"
    empty = vdb.FloatGrid(2.0)
    empty.name = "nothing"
    others += [ball, empty]
    others[0]["artist"], others[0]["frame"], others[0]["where"] = "somebody", 7, (1.0, 2.0, 3.0)
    others[2].gridClass = vdb.GridClass.STAGGERED
    others[2]["vector_type"], others[2]["is_local_space"] = "contravariant relative", True
if kind == "half":
    others += [filled(vdb.FloatGrid(0.1), "temperature", real), filled(vdb.Vec3SGrid(), "vel", vector)]
    for grid in others:
        grid.saveFloatAsHalf = True
if kind == "frustum":
    others.append(filled(vdb.FloatGrid(), "wide", real, vdb.createFrustumTransform((0, 0, 0), (10, 10, 10), 0.5, 10)))
if kind == "instances":
    first = filled(vdb.FloatGrid(), "first", real)
    second = first.copy()
    second.name, second.transform = "second", skewed
    others += [first, second]
if kind == "twice":
    others += [filled(vdb.FloatGrid(), "heat", real), filled(vdb.FloatGrid(1.0), "heat", real)]
if kind == "source":
    others.append(filled(vdb.FloatGrid(), "source", real))
if kind == "smoke":
    others += [density("smoke"), filled(vdb.FloatGrid(), "heat", real)]
vdb.write(path, grids=[density(), *others])
"""

COMPARE = START + r"""
one, two, up, *names = sys.argv[1:]
before, after = (vdb.readAll(path)[0] for path in (one, two))
# The module sorts by name.
assert [grid.name for grid in after] == sorted(["density", *names]), [grid.name for grid in after]
kept = [grid for grid in before if grid.name in names]
turn = (lambda p: np.array([p[0], p[2], -p[1]])) if up == "y" else np.array
for a, b in zip(kept, (grid for grid in after if grid.name in names)):
    same = [(grid.name, grid.valueTypeName, grid.gridClass, grid.saveFloatAsHalf, grid.background,
             grid.creator) for grid in (a, b)]
    assert same[0] == same[1], same
    metadata = [{k: v for k, v in grid.metadata.items() if not k.startswith("file_")} for grid in (a, b)]
    assert metadata[0] == metadata[1], metadata
    for index in [(0.0, 0.0, 0.0), (3.0, -5.0, 7.0), (10.0, 1.0, 4.0)]:
        x, y = turn(a.transform.indexToWorld(index)), b.transform.indexToWorld(index)
        assert np.abs(x - y).max() < 1e-12 if up == "y" else tuple(x) == tuple(y), (a.name, index, x, y)
    items = [[(item.min, item.max, item.count, item.value, item.depth) for item in grid.citerAllValues() if item.depth > 0 or item.value]
             for grid in (a, b)]
    assert items[0] == items[1] and (len(items[0]) > 500 or a.name == "nothing"), (a.name, len(items[0]), len(items[1]))
    active = [[(item.min, item.max, item.value) for item in grid.citerOnValues()] for grid in (a, b)]
    assert active[0] == active[1], a.name
"""


def debian(script, *arguments):
    process = subprocess.run(["/usr/bin/python3", "-c", script, *map(str, arguments)], capture_output=True, text=True, cwd="/")
    assert process.returncode == 0, process.stderr
    return process.stdout


def made(folder, kind):
    debian(MAKE, folder / "smoke.vdb", kind)
    return folder / "smoke.vdb"


KEPT = {
    "kinds": ["temperature", "mask", "vel", "surface", "nothing"],
    "half": ["temperature", "vel"],
    "frustum": ["wide"],
    "instances": ["first", "second"],
    "twice": ["heat", "heat"],
}


@pytest.mark.parametrize("up", ["z", "y"])
@pytest.mark.parametrize("kind", KEPT)
def test_grids_are_carried_as_they_are(cloudvdb, tmp_path, kind, up):
    smoke = made(tmp_path, kind)
    report = cloudvdb.make(smoke, tmp_path, "--up", up)
    debian(COMPARE, smoke, tmp_path / "out.vdb", up, *KEPT[kind])
    vectors = [note for note in report.notes if '"vel"' in note]
    assert len(vectors) == (up == "y" and "vel" in KEPT[kind]) and not any("left out" in note for note in report.notes)


def test_what_is_written_anew_comes_once(cloudvdb, tmp_path):
    smoke = made(tmp_path, "source")
    (tmp_path / "both").mkdir()
    report = cloudvdb.make(smoke, tmp_path / "both", "--grids", "density,source")
    assert any('"source" (float) is left out' in note for note in report.notes), report.notes
    debian(COMPARE.replace("*names])", '"source"])'), smoke, tmp_path / "both" / "out.vdb", "z")
    report = cloudvdb.make(smoke, tmp_path)
    assert not any("left out" in note for note in report.notes), report.notes
    debian(COMPARE, smoke, tmp_path / "out.vdb", "z", "source")


def test_another_grid_as_the_cloud_replaces_the_density(cloudvdb, tmp_path):
    smoke = made(tmp_path, "smoke")
    report = cloudvdb.make(smoke, tmp_path, "--grid", "smoke")
    assert any('"density" (float) is left out' in note for note in report.notes), report.notes
    debian(COMPARE, smoke, tmp_path / "out.vdb", "z", "heat")


def test_equal_runs_make_equal_bytes(cloudvdb, tmp_path):
    smoke = made(tmp_path, "kinds")
    one, two = tmp_path / "one.vdb", tmp_path / "two.vdb"
    cloudvdb.succeed(smoke, "--threads", "1", "-o", one)
    cloudvdb.succeed(smoke, "--threads", "2", "-o", two)
    assert one.read_bytes() == two.read_bytes()


@pytest.mark.parametrize("kind", ["kinds", "half"])
def test_damaged_grids_are_sentences_and_leave_nothing(cloudvdb, tmp_path, kind):
    whole = made(tmp_path, kind).read_bytes()
    smoke = tmp_path / "damaged.vdb"
    (tmp_path / "out").mkdir()
    # Cut short at many places.
    for cut in range(len(whole) // 4, len(whole), len(whole) // 23):
        smoke.write_bytes(whole[:cut])
        cloudvdb.refuse(smoke, "-o", tmp_path / "out" / "lit.vdb", says=["damaged.vdb"], folder=tmp_path / "out")
    # A byte here and there: either it changes nothing that matters, or it is refused; it never ends in a crash.
    refused = 0
    for at in range(len(whole) // 3, len(whole), len(whole) // 61):
        smoke.write_bytes(whole[:at] + bytes([whole[at] ^ 0x5A]) + whole[at + 1:])
        ran = cloudvdb.run(smoke, "-o", tmp_path / "out" / f"{at}.vdb")
        assert ran.code in (0, 1) and len(ran.err.strip().splitlines()) >= (ran.code == 1), ran
        refused += ran.code
    assert refused > 5
