"""The grids hold the optical mass of what was written into them, as OpenVDB's own Python module reads them."""
import numpy as np
import pytest

import gltf
import projection
import vdbinfo
from layouts import BALLS, FAST, three_balls


@pytest.fixture(scope="module")
def layout(tmp_path_factory):
    return three_balls(tmp_path_factory.mktemp("layout") / "three.glb")


MASS = projection.mass(BALLS)
CENTRE = sum(b.mass * np.array(b.centre) for b in BALLS) / MASS


@pytest.mark.parametrize("precision", [(), ("--float32",)], ids=["half", "float32"])
@pytest.mark.parametrize("voxel", [0.03, 0.05, 0.08])
@pytest.mark.parametrize("density", ["source", "duality"])
def test_mass(cloudvdb, layout, tmp_path, density, voxel, precision):
    report = cloudvdb.make(layout, tmp_path, *FAST, "--density", density, "--voxel-size", voxel, *precision)
    grid = vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    mass = grid["integral"] * report.density_scale
    assert mass == pytest.approx(report.mass_written, rel=5e-3)
    assert report.mass_source == pytest.approx(MASS, rel=2e-3)
    assert grid["voxel_size"] == pytest.approx(voxel, rel=1e-6) == report.voxel_size
    assert grid["half"] is (not precision)
    assert grid["nonfinite"] == 0 and grid["min"] >= 0 and grid["background"] == 0
    if density == "source":
        assert mass == pytest.approx(MASS, rel=5e-3)
        assert grid["centroid"] == pytest.approx(CENTRE, abs=0.02 * voxel)
    else:
        # The budget: what was synthesised and what is missing make up the source.
        assert report.mass_written + report.mass_missing == pytest.approx(report.mass_source, rel=1e-3)
        assert report.regions_synthesised > 0
        # The duality moves mass toward where light scatters, not out of the layout.
        low, high = projection.bounds(BALLS)
        assert np.all(np.array(grid["centroid"]) > low) and np.all(np.array(grid["centroid"]) < high)


def test_what_the_grid_is(cloudvdb, layout, tmp_path):
    report = cloudvdb.make(layout, tmp_path, "--density", "source", "--voxel-size", "0.05")
    found = vdbinfo.read(tmp_path / "out.vdb")
    assert list(found["grids"]) == ["density"]
    grid = found["grids"]["density"]
    assert grid["class"] == "fog volume" and grid["type"] == "float"
    assert grid["metadata"]["file_compression"].startswith("blosc")
    # Aligned with the world's axes; whole voxels from the origin or halves, as the file's own transform says.
    assert np.allclose(grid["axes"], 0.05 * np.eye(3))
    # Where the layout is and no further: a voxel of coverage on every side.
    low, high = projection.bounds(BALLS)
    reach = np.array(grid["bbox"]) * 0.05 + np.array(grid["origin"])
    assert np.all(np.abs(reach - [low, high]) <= 0.05 * 1.5)
    told = " ".join(f"{k}={v}" for k, v in {**found["metadata"], **grid["metadata"]}.items()).lower()
    for word in ("cloudvdb", "seed", "albedo", "sigma", "unit"):
        assert word in told, told
    # The densest voxels lie where the balls of 4 and 8 per metre overlap: extinctions add.
    assert grid["max"] * report.density_scale == pytest.approx(12.0, rel=2e-3)


def test_position_is_openvdbs_own(cloudvdb, tmp_path):
    """A ball about the origin and one far away: the centre of mass by the file's transform is the ball's centre."""
    for i, centre in enumerate([(0.0, 0.0, 0.0), (1000.3, -2000.7, 500.1)]):
        scene = gltf.scene(tmp_path / f"{i}.glb", gltf.ball(centre=centre, sigma_s=3.0, sigma_a=0.0, g=0.5))
        cloudvdb.succeed(scene, "--density", "source", "--voxel-size", "0.1", "-o", tmp_path / f"{i}.vdb")
        grid = vdbinfo.read(tmp_path / f"{i}.vdb")["grids"]["density"]
        assert grid["centroid"] == pytest.approx(centre, abs=2e-3)


def test_up_y(cloudvdb, layout, tmp_path):
    """For Houdini and USD: (x, y, z) is written at (x, z, -y)."""
    report = cloudvdb.make(layout, tmp_path, "--density", "source", "--voxel-size", "0.05", "--up", "y")
    grid = vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    assert grid["integral"] * report.density_scale == pytest.approx(MASS, rel=5e-3)
    assert grid["centroid"] == pytest.approx((CENTRE[0], CENTRE[2], -CENTRE[1]), abs=0.002)


def test_source_grid_beside_the_duality(cloudvdb, layout, tmp_path):
    report = cloudvdb.make(layout, tmp_path, *FAST, "--voxel-size", "0.05", "--grids", "density,source")
    grids = vdbinfo.read(tmp_path / "out.vdb")["grids"]
    assert set(grids) == {"density", "source"}
    assert grids["source"]["integral"] * report.density_scale == pytest.approx(MASS, rel=5e-3)
    assert grids["source"]["centroid"] == pytest.approx(CENTRE, abs=0.001)
    assert grids["density"]["integral"] * report.density_scale == pytest.approx(report.mass_written, rel=5e-3)


def test_max_voxels_coarsens_and_says_so(cloudvdb, layout, tmp_path):
    report = cloudvdb.make(layout, tmp_path, "--density", "source", "--max-voxels", "600")
    grid = vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    assert grid["active"] <= 600 * 1.1
    assert grid["integral"] * report.density_scale == pytest.approx(MASS, rel=5e-3)
    assert any("voxel" in note.lower() for note in report.notes), report.notes


def test_slab_fills_its_tile(cloudvdb, scenes, tmp_path):
    report = cloudvdb.make(scenes / "slab.gltf", tmp_path, "--density", "source")
    grid = vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    assert grid["centroid"][2] == pytest.approx(500.0, abs=1.0)
    assert grid["integral"] * report.density_scale == pytest.approx(report.mass_written, rel=5e-3)
    # 0.04 per metre along 200 m, whatever the tile.
    assert grid["max"] * report.density_scale == pytest.approx(0.04, rel=5e-3)


def graded(folder):
    """A VDB whose density varies a hundredfold, with detail of a few voxels."""
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, 40)] * 3, indexing="ij")
    values = np.where(x * x + y * y + z * z < 1, 10 ** (-1 - x) * (1 + 0.5 * np.sin(25 * y) * np.cos(20 * z)), 0)
    return vdbinfo.write_values(folder / "graded.vdb", values, 0.05, (3.0, -2.0, 1.0))


@pytest.mark.parametrize("placement", ["uniform", "importance"])
def test_the_duality_of_a_vdb_keeps_its_mass(cloudvdb, tmp_path, placement):
    """By OpenVDB's own reading of what went in and of what came out; what was made lies where there was something."""
    source, flags = graded(tmp_path), ("--sigma-t", "60")
    report = cloudvdb.make(source, tmp_path, "--density", "duality", "--placement", placement, "--photons", "50000", *flags)
    before, after = vdbinfo.read(source)["grids"]["density"], vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    assert report.mass_missing == pytest.approx(0, abs=1e-9 * report.mass_source)
    assert report.mass_source == pytest.approx(60 * before["integral"], rel=1e-6)
    assert after["integral"] * report.density_scale == pytest.approx(60 * before["integral"], rel=5e-3)
    assert report.regions_synthesised > 10
    low, high = (np.array(before["bbox"]) * 0.05 + before["origin"])
    reach = np.array(after["bbox"]) * after["voxel_size"] + after["origin"]
    assert np.all(reach[0] > low - 0.11) and np.all(reach[1] < high + 0.11)
    # Overlapping balls add, and between them there is nothing.
    assert after["active"] * after["voxel_size"] ** 3 < 0.98 * before["active"] * 0.05 ** 3 or after["max"] > 1.5 * before["max"]
    table = cloudvdb.succeed("flux", source, "--density", "duality", "--photons", "20000", *flags).out
    assert "100.0000 %" in table and cloudvdb.succeed("plan", source, "--density", "duality").out
