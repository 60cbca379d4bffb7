"""Shapes through the whole command: metaballs as Blender shows them, details that repeat, soft meshes."""
import json
import subprocess

import numpy as np
import pytest

import vdbinfo
from command import SCENES, make, succeed
from metaball_families import families

# A voxel along each vertex's normal: what is inside holds density, what is outside none.
SIDES = r"""
import json, sys
import pyopenvdb as vdb
grid = vdb.read(sys.argv[1], "density")
points = json.load(open(sys.argv[2]))
value = grid.getConstAccessor().getValue
json.dump([[value(tuple(round(i) for i in grid.transform.worldToIndex(tuple(p)))) for p in side] for side in points], sys.stdout)
"""


def values(path, sides, folder):
    points = folder / "points.json"
    points.write_text(json.dumps(sides))
    done = subprocess.run(["/usr/bin/python3", "-c", SIDES, str(path), str(points)], check=True, stdout=subprocess.PIPE, text=True)
    return [np.array(side) for side in json.loads(done.stdout)]


def test_metaballs_lie_where_blender_shows_them(tmp_path):
    """Families that no test has seen before, Blender's own mesh, our grid: the surface is within a voxel."""
    found = families(1000, 6)["families"]
    for number, family in enumerate(found):
        layout = tmp_path / f"family{number}.gltf"
        nodes = family["nodes"]
        layout.write_text(json.dumps({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes}))
        folder = tmp_path / str(number)
        folder.mkdir()
        report = make(layout, folder, "--density", "source", "--max-voxels", "2M")
        voxel = report.data["vdb"]["voxel_size"]
        vertices, normals = np.array(family["vertices"]), np.array(family["normals"])
        # The sample nearest to a point lies at most half a diagonal off, and an elongated element's field falls slowly along it.
        inside, outside = values(folder / "out.vdb", [(vertices - 2 * voxel * normals).tolist(), (vertices + 2 * voxel * normals).tolist()], tmp_path)
        assert len(vertices) > 20
        assert (inside > 0).mean() > 0.97 and (outside == 0).mean() > 0.97, (number, (inside > 0).mean(), (outside == 0).mean())


def test_detail_changes_the_cloud_and_nothing_but_the_seed_its_bytes(tmp_path):
    def run(name, detail):
        out = tmp_path / f"{name}.vdb"
        succeed(SCENES / "cumulus.gltf", "--density", "source", "--detail", detail, "--max-voxels", "300k", "-o", out)
        return out.read_bytes()

    first = run("a", "congestus:octaves=3")
    assert first == run("b", "congestus:octaves=3") and first != run("c", "congestus:octaves=3,seed=1")
    smooth = make(SCENES / "cumulus.gltf", tmp_path, "--density", "source", "--detail", "congestus:strength=0", "--voxel-size", "20")
    assert smooth.mass_written == pytest.approx(smooth.data["optical_mass"]["source"], rel=1e-12)


def test_a_deck_repeats_its_tile(tmp_path):
    """A slab with detail is a grid of its tile; light finds no end of it."""
    report = make(SCENES / "slab.gltf", tmp_path, "--density", "source", "--detail", "stratocumulus:octaves=3", "--max-voxels", "300k")
    grid = vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    assert report.data["vdb"]["grids"][0]["active_voxels"] == grid["active"]
    balance = json.loads(succeed("flux", SCENES / "slab.gltf", "--detail", "stratocumulus:octaves=3", "--max-voxels", "300k", "--photons", "20k", "--json").out)
    shares = [balance[key]["value"] for key in ("up", "down_direct", "down_diffuse", "absorbed_medium", "absorbed_surface")]
    assert sum(shares) == pytest.approx(1, abs=1e-6) and 0.1 < shares[0] < 0.9


def test_the_duality_keeps_a_sculptures_mass(tmp_path):
    report = make(SCENES / "cumulus.gltf", tmp_path, "--detail", "humilis:octaves=3", "--max-voxels", "300k", "--photons", "100k")
    mass = report.data["optical_mass"]["source"]
    assert report.mass_written == pytest.approx(mass, rel=5e-3)
    grid = vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    assert grid["integral"] * report.data["vdb"]["density_scale"] == pytest.approx(mass, rel=5e-3)
