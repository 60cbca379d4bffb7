"""Reads and writes VDB files with OpenVDB's own Python module: an oracle that shares no code with the command.

Debian builds the module for /usr/bin/python3 alone, so it runs there, in a process of its own.
"""
import json
import math
import pathlib
import subprocess
import tempfile

import numpy as np

READ = r"""
import json, sys
import numpy as np, pyopenvdb as vdb

def facts(grid):
    low, high = (np.array(v) for v in grid.evalActiveVoxelBoundingBox())
    count = grid.activeVoxelCount()
    origin = np.array(grid.transform.indexToWorld((0.0, 0.0, 0.0)))
    axes = np.array([grid.transform.indexToWorld(tuple(map(float, e))) for e in np.eye(3, dtype=int)]) - origin
    out = {"name": grid.name, "type": grid.valueTypeName, "class": str(grid.gridClass), "half": grid.saveFloatAsHalf,
           "active": count, "leaves": grid.leafCount(), "background": grid.background, "origin": origin.tolist(),
           "axes": axes.tolist(), "uniform": grid.transform.isLinear, "metadata": {k: str(v) for k, v in grid.metadata.items()}}
    if not count:
        return dict(out, sum=0.0, bbox=None)
    total, first, peak, least, bad = 0.0, np.zeros(3), 0.0, np.inf, 0
    step = 32
    for x in range(low[0], high[0] + 1, step):
        thick = min(step, high[0] + 1 - x)
        block = np.zeros((thick, high[1] - low[1] + 1, high[2] - low[2] + 1), np.float32)
        grid.copyToArray(block, ijk=(int(x), int(low[1]), int(low[2])))
        bad += int((~np.isfinite(block)).sum())
        block = block.astype(np.float64)
        total += block.sum(); peak = max(peak, block.max()); least = min(least, block.min())
        for k, offset in enumerate((x, low[1], low[2])):
            others = tuple(j for j in range(3) if j != k)
            first[k] += (block.sum(axis=others) * (offset + np.arange(block.shape[k]))).sum()
    voxel = abs(np.linalg.det(axes))
    mean = first / total if total else np.zeros(3)
    return dict(out, sum=total, integral=total * voxel, max=float(peak), min=float(least), nonfinite=bad,
                bbox=[low.tolist(), high.tolist()], voxel_size=voxel ** (1 / 3), centroid=(origin + mean @ axes).tolist())

path = sys.argv[1]
grids, metadata = vdb.readAll(path)
json.dump({"grids": [facts(g) for g in grids], "metadata": {k: str(v) for k, v in metadata.items()}}, sys.stdout)
"""

WRITE = r"""
import sys
import numpy as np, pyopenvdb as vdb
data = np.load(sys.argv[1])

def made(name):
    grid = vdb.FloatGrid(0.0)
    grid.name, grid.gridClass, grid.saveFloatAsHalf = name, vdb.GridClass.FOG_VOLUME, bool(data["half"])
    grid.copyFromArray(np.ascontiguousarray(data["grid_" + name], np.float32), ijk=tuple(int(i) for i in data["low"]))
    # OpenVDB's matrices multiply rows.
    grid.transform = vdb.createLinearTransform(data["matrix"].T.tolist())
    grid.prune()
    return grid

vdb.write(sys.argv[2], grids=[made(key[5:]) for key in data.files if key.startswith("grid_")])
"""


def _debian(script, *arguments):
    process = subprocess.run(["/usr/bin/python3", "-c", script, *map(str, arguments)], capture_output=True, text=True,
                             cwd="/", stdin=subprocess.DEVNULL)
    assert process.returncode == 0, process.stderr
    return process.stdout


def read(path):
    """`{"grids": {name: facts}, "metadata": {...}}`: facts are sum, integral (dV), centroid (world), bbox (index),
    voxel_size, half, class, active, min, max, metadata and so on."""
    found = json.loads(_debian(READ, pathlib.Path(path).resolve()))
    names = [grid["name"] for grid in found["grids"]]
    assert len(set(names)) == len(names), f"two grids of one name: {names}"
    return dict(found, grids={grid["name"]: grid for grid in found["grids"]})


def coverage(balls, voxel, fine=8):
    """Summed density of `balls`, ((x, y, z), radius, sigma), on voxels with samples at whole multiples of `voxel`.

    Voxels at a surface have the part that lies inside, by fine^3 points: the slow, obvious way. Returns values and the
    index of the first voxel.
    """
    low = np.array([min(math.floor((c[k] - r) / voxel) - 1 for c, r, _ in balls) for k in range(3)])
    high = np.array([max(math.ceil((c[k] + r) / voxel) + 1 for c, r, _ in balls) for k in range(3)])
    values = np.zeros(high - low + 1)
    spread = (np.arange(fine) + 0.5) / fine - 0.5
    points = np.stack(np.meshgrid(spread, spread, spread, indexing="ij"), -1).reshape(-1, 3) * voxel
    for centre, radius, sigma in balls:
        first = np.floor((np.array(centre) - radius) / voxel).astype(int) - 1
        last = np.ceil((np.array(centre) + radius) / voxel).astype(int) + 1
        axes = [np.arange(first[k], last[k] + 1) * voxel - centre[k] for k in range(3)]
        place = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
        away = np.linalg.norm(place, axis=-1)
        part = (away < radius).astype(float)
        near = np.abs(away - radius) < voxel * 0.87
        inside = np.linalg.norm(place[near][:, None, :] + points[None], axis=-1) < radius
        part[near] = inside.mean(axis=1)
        window = tuple(slice(first[k] - low[k], last[k] - low[k] + 1) for k in range(3))
        if any(w.start < 0 for w in window):
            raise ValueError("a ball leaves the grid")
        values[window] += sigma * part
    return values, low


def write_values(path, values, voxel, origin, place=None, low=(0, 0, 0), half=False, **others):
    """A VDB of `values` (x, y, z) named density and of `others` by their names, whose sample (0, 0, 0) is at `origin` and whose first is number `low`. 32-bit floats.
    `place`, 4 x 4, is laid on the world of the grid: it becomes a part of the transform in the file."""
    matrix = np.diag([voxel] * 3 + [1.0])
    matrix[:3, 3] = origin
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        grids = {f"grid_{name}": array for name, array in dict(others, density=values).items()}
        np.savez(file, **grids, low=low, matrix=matrix if place is None else np.array(place) @ matrix, half=half)
        file.flush()
        _debian(WRITE, file.name, path)
    return path


def write_balls(path, balls, voxel, scale=1.0, shift=(0.0, 0.0, 0.0), half=False):
    """A VDB of `balls`, with deliberate faults on request: values times `scale`, everything moved by `shift` voxels."""
    values, low = coverage(balls, voxel)
    return write_values(path, values * scale, voxel, np.array(shift) * voxel, low=low, half=half)
