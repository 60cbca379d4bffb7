"""Volume objects that Blender exports as nodes with a custom property: they are where Blender shows them."""
import json

import numpy as np
import pytest

import gltf
import vdbinfo
from blender import blender

VOXEL = 0.05
BALLS = [((0.3, 0.0, 0.1), 0.5, 1.0), ((-0.4, 0.35, 0.3), 0.3, 2.0), ((0.1, -0.5, -0.4), 0.2, 3.0)]
PLACE = {"location": (1.5, -2.0, 3.0), "rotation_euler": (0.4, -0.7, 1.1), "scale": (1.6, 0.7, 1.1)}
CENTRE, WIDTH, PIXELS = PLACE["location"], 3.6, 48

EXPORT = """
start()
volume = import_volume(given["vdb"])
volume.name = "Smoke"
for key, value in given["place"].items():
    setattr(volume, key, value)
volume["cloudvdb"] = given["property"]
bpy.context.view_layer.update()
out["matrix"] = [list(row) for row in volume.matrix_world]
export(given["glb"])
"""

LOOK = """
# Blender 4.5 shows a VDB half a voxel of its own too far along each of its axes.
back = Matrix.Translation((-shift() * given["voxel"],) * 3)
_, images = transmittance(given["vdb"], given["views"], given["width"], given["pixels"], given["density"],
                          matrix=Matrix(given["matrix"]) @ back)
arrays["depths"] = np.array([-np.log(np.clip(image, 1e-12, None)) for *_, image in images])
"""


def look(vdb, voxel, matrix, density):
    """Optical depths from two sides, along all three axes, as Cycles shows a VDB."""
    views = [(CENTRE, axis) for axis in "xz"]
    return blender(LOOK, vdb=str(vdb), voxel=voxel, matrix=matrix, density=density, views=views, width=WIDTH, pixels=PIXELS)["arrays"]["depths"]


def centroid(depth):
    at = ((np.arange(PIXELS) + 0.5) / PIXELS - 0.5) * WIDTH
    return np.array([depth.sum(axis=0) @ at, depth.sum(axis=1) @ at]) / depth.sum()


@pytest.fixture(scope="module")
def smoke(tmp_path_factory):
    """The VDB, the layout beside it, and the matrix of the object."""
    folder = tmp_path_factory.mktemp("smoke")
    vdb, glb = vdbinfo.write_balls(folder / "smoke.vdb", BALLS, VOXEL), folder / "layout.glb"
    told = json.dumps({"shape": "vdb", "file": "smoke.vdb", "sigma_t": 2.0, "albedo": 0.9, "g": 0.5})
    out = blender(EXPORT, vdb=str(vdb), glb=str(glb), place=PLACE, property=told)
    return vdb, glb, out["matrix"]


def test_blender_writes_the_node(smoke):
    """An empty node with the property; what makes the rest of this file a test of anything."""
    (node,) = gltf.read(smoke[1])["nodes"]
    assert "mesh" not in node and "smoke.vdb" in node["extras"]["cloudvdb"] and "rotation" in node


def test_it_is_where_blender_shows_it(cloudvdb, smoke, tmp_path):
    vdb, glb, matrix = smoke
    report = cloudvdb.make(glb, tmp_path, "--density", "source", "--voxel-size", "0.04", "--float32")
    (grid,) = vdbinfo.read(tmp_path / "out.vdb")["grids"].values()
    # The integral, and the centre, by OpenVDB's own module and the matrix alone.
    before, m = vdbinfo.read(vdb)["grids"]["density"], np.array(matrix)
    scale = report.density_scale / 2.0
    assert grid["integral"] * scale == pytest.approx(before["integral"] * np.prod(PLACE["scale"]), rel=2e-3)
    centre = m[:3, :3] @ before["centroid"] + m[:3, 3]
    assert np.abs(np.array(grid["centroid"]) - centre).max() < 1e-3
    # The same from two sides, in Cycles, which knows nothing of the node.
    expected = look(vdb, VOXEL, matrix, 0.2)
    seen = look(tmp_path / "out.vdb", 0.04, np.eye(4).tolist(), 0.2 * scale)
    for a, b in zip(seen, expected):
        assert a.sum() == pytest.approx(b.sum(), rel=5e-3)
        assert np.abs(centroid(a) - centroid(b)).max() < 0.05 * VOXEL
        # A shape resampled: its edges are softer by a voxel.
        assert np.sqrt(((a - b) ** 2).mean() / (b ** 2).mean()) < 0.03


def test_what_it_cannot_do_is_refused(cloudvdb, smoke, tmp_path):
    cloudvdb.refuse(smoke[1], "-o", tmp_path / "out.glb", says=["glTF", "Smoke"], code=2, folder=tmp_path)
    cloudvdb.refuse(smoke[1], "--density", "source", "-o", tmp_path / "out.glb", says=["glTF", "Smoke"], code=2, folder=tmp_path)
    cloudvdb.refuse(smoke[1], "--density", "source", "--periodic", "xy", "-o", tmp_path / "out.exr", says=["Smoke", "horizontal"], folder=tmp_path)
    over = smoke[0].read_bytes()
    cloudvdb.refuse(smoke[1], "--density", "source", "--overwrite", "-o", smoke[0], says=["smoke.vdb"], code=2)
    assert smoke[0].read_bytes() == over
