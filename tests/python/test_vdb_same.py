"""A bare VDB comes out in its own lattice, sample by sample, as OpenVDB's own Python module reads both."""
import subprocess

import pytest

COMMON = r"""
import sys
import numpy as np, pyopenvdb as vdb

def matrix(grid):
    at = [np.array(grid.transform.indexToWorld(tuple(map(float, index)))) for index in [*np.eye(3), np.zeros(3)]]
    return np.array([axis - at[3] for axis in at[:3]] + at[3:])
"""

WRITE = COMMON + r"""
path, kind = sys.argv[1:]
grid = vdb.FloatGrid(0.0)
grid.name, grid.gridClass = "density", vdb.GridClass.FOG_VOLUME
at = {"far": (1 << 20, -(1 << 20), 5)}.get(kind, (-3, 6, 11))
values = np.random.default_rng(1).uniform(0.0, 3.0, (21, 17, 30)).astype(np.float32)
values[values < 1.0] = 0.0
grid.copyFromArray(values, ijk=at)
grid.prune()
if kind == "tiles":
    grid.fill((64, 0, 0), (127, 63, 63), 0.75, True)
    grid.fill((0, 64, 0), (7, 71, 7), 1.25, True)
if kind == "inactive":
    grid.fill((0, 8, 16), (7, 15, 23), 2.5, False)
if kind == "turned":
    c, d = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, d, 0], [-d, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, d, c], [0, -c, d]])
    rows = np.diag([0.1, 0.25, 0.4]) @ turn
    grid.transform = vdb.createLinearTransform([[*row, 0.0] for row in rows.tolist()] + [[50.0, -70.0, 3.3, 1.0]])
elif kind == "stretched":
    grid.transform = vdb.createLinearTransform([[0.1, 0, 0, 0], [0.02, 0.2, 0, 0], [0, 0.05, 0.3, 0], [5, -7, 9, 1]])
else:
    grid.transform = vdb.createLinearTransform(0.1)
vdb.write(path, grids=[grid])
"""

COMPARE = COMMON + r"""
one, two = (vdb.read(path, "density") for path in sys.argv[1:3])
a, b = matrix(one), matrix(two)
if sys.argv[3] == "y":
    a = np.stack([a[:, 0], a[:, 2], -a[:, 1]], axis=1)
assert np.abs(a - b).max() < 1e-9 * max(1.0, np.abs(a).max()), (a, b)
ends = np.array([one.evalActiveVoxelBoundingBox(), two.evalActiveVoxelBoundingBox()])
low, high = ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
arrays = []
for grid in (one, two):
    array = np.zeros(high - low + 1, np.float32)
    grid.copyToArray(array, ijk=tuple(int(i) for i in low))
    arrays.append(array)
if sys.argv[4] == "inactive":
    x, y, z = np.array([0, 8, 16]) - low
    assert (arrays[0][x:x + 8, y:y + 8, z:z + 8] == 2.5).all()
    arrays[0][x:x + 8, y:y + 8, z:z + 8] = 0.0
assert (np.abs(arrays[0] - arrays[1]) <= np.abs(arrays[0]) / 2048).all(), np.abs(arrays[0] - arrays[1]).max()
assert arrays[1].max() > 0 and two.background == 0
print(two.activeVoxelCount(), (arrays[0] != 0).sum())
"""


def debian(script, *arguments):
    process = subprocess.run(["/usr/bin/python3", "-c", script, *map(str, arguments)], capture_output=True, text=True, cwd="/")
    assert process.returncode == 0, process.stderr
    return process.stdout


@pytest.mark.parametrize("up", ["z", "y"])
@pytest.mark.parametrize("kind", ["plain", "far", "tiles", "inactive", "turned", "stretched"])
def test_it_comes_out_as_it_went_in(cloudvdb, tmp_path, kind, up):
    smoke, lit = tmp_path / "smoke.vdb", tmp_path / "lit.vdb"
    debian(WRITE, smoke, kind)
    cloudvdb.succeed(smoke, "--up", up, "-o", lit)
    active, other_than_zero = map(int, debian(COMPARE, smoke, lit, up, kind).split())
    assert active == other_than_zero
