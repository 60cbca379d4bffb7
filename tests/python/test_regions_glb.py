"""The synthesised regions as a .glb: Blender opens them, and what Blender writes again comes back in."""
import numpy as np
import pytest

import gltf
import projection
from blender import blender
from layouts import BALLS, FAST, three_balls, to_balls

ROUND_TRIP = """
start()
out["balls"] = import_balls(given["path"])
out["objects"] = [o.name for o in bpy.data.objects]
out["meshes"] = len(bpy.data.meshes)
export(given["again"])
"""


@pytest.fixture(scope="module")
def trip(cloudvdb, tmp_path_factory):
    folder = tmp_path_factory.mktemp("regions")
    report = cloudvdb.make(three_balls(folder / "three.glb"), folder, *FAST, outputs=("regions.glb", "out.vdb"))
    found = blender(ROUND_TRIP, path=str(folder / "regions.glb"), again=str(folder / "again.glb"))
    return folder, report, found


def test_every_region_is_an_object(trip):
    _, report, found = trip
    assert len(found["balls"]) == report.regions_synthesised > 10
    # One mesh, linked: thousands of regions stay a small file.
    assert found["meshes"] <= 2


def test_places_and_sizes(trip):
    folder, _, found = trip
    document = gltf.read(folder / "regions.glb")
    expected = sorted((*gltf.z_up(m[:3, 3]), np.linalg.norm(m[:3, 0])) for i, m in gltf.world_matrices(document).items()
                      if "mesh" in document["nodes"][i])
    seen = sorted((*b["centre"], b["radius"]) for b in found["balls"])
    assert np.allclose(expected, seen, rtol=2e-3, atol=1e-4)


def test_they_lie_in_the_layout(trip):
    """Their centres do, by construction; the balls may stick out by their radius."""
    for ball in trip[2]["balls"]:
        away = min(np.linalg.norm(np.array(ball["centre"]) - b.centre) - b.radius for b in BALLS)
        assert away < 1e-3, ball


def test_photon_counts_are_custom_properties(trip):
    _, report, found = trip
    photons = [ball["cloudvdb"]["photons"] for ball in found["balls"]]
    assert all(isinstance(n, int) and n >= 1 for n in photons)


def test_their_mass(trip):
    _, report, found = trip
    assert projection.mass(to_balls(found["balls"])) == pytest.approx(report.mass_written, rel=5e-3)


@pytest.mark.parametrize("name", ["regions.glb", "again.glb"])
def test_they_come_back(cloudvdb, trip, tmp_path, name):
    """As cloudvdb wrote them, and after Blender has opened and exported them again."""
    folder, report, _ = trip
    again = cloudvdb.make(folder / name, tmp_path, "--density", "source")
    assert again.regions_source == report.regions_synthesised
    assert again.mass_source == pytest.approx(report.mass_written, rel=5e-3)
