"""Lamps, and what shines by itself, in the script for Blender: Cycles shows, live and baked, what the path tracer shows."""
import json

import numpy as np
import pytest

import command
import gltf
import peers
import vdbinfo
from bakes import shown

SIZE = ["--size", "48x36", "--density", "source"]
#: A coloured point light and a narrow blue spot with a wide soft edge.
POINT = {"position": (0.3, -1.5, 2.0), "intensity": 8.0, "color": [1.0, 0.6, 0.3]}
SPOT = {"position": (-2.0, -0.5, 2.4), "intensity": 20.0, "color": [0.3, 0.6, 1.0], "type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.6}}
MEDIUM = {"sigma_t": 6.0, "albedo": 0.99, "g": 0.7}


@pytest.fixture(params=["4.5", pytest.param("5.2", marks=pytest.mark.long)])
def python(request):
    """A Python with that Blender; `None` is this one."""
    found = peers.newer_blender() if request.param == "5.2" else None
    if request.param == "5.2" and not found:
        pytest.skip("CLOUDVDB_BPY52 names no Python with bpy 5.2")
    return found


def lit(path, lamps, balls=True, ground=True):
    """Balls (or one that is out of sight) between lamps, above a ground."""
    nodes = [gltf.ball("A", (-0.6, 0, 0.3), 0.6, **MEDIUM), gltf.ball("B", (0.9, 0.2, 0.5), 0.5, **MEDIUM)]
    document, blob = gltf.document(nodes if balls else [gltf.ball("A", (40, 0, 0.3), 0.1, sigma_t=0.01)], sun=False)
    for lamp in lamps:
        gltf.add_lamp(document, **lamp)
        # glTF's y is up; spots shine down along their -Z: this one toward (0.4, -0.3, 0) and so askew.
        axis = np.array((2.4, -2.4, -0.2)) / np.linalg.norm((2.4, -2.4, -0.2))
        turn = np.append(np.cross((0, 0, -1), axis), 1 - axis[2])
        document["nodes"][-1].update(rotation=(turn / np.linalg.norm(turn)).tolist(), extras={"cloudvdb": {"lamp_radius": 0.2}})
    if ground:
        blob = gltf.add_ground(document, blob, z=-0.5, albedo=0.5)
    document["extensionsUsed"] = ["KHR_lights_punctual"]
    return gltf.write(path, document, blob)


def script(source, folder, *flags):
    """The script, and the VDB beside it."""
    command.succeed(source, "-o", folder / "cloud.vdb", "-o", folder / "cloud.blend.py", "--overwrite", "-q", *SIZE, *flags)
    return folder / "cloud.blend.py"


def truth(source, folder, *flags, spp):
    """The path tracer's picture, and the relative standard error of its mean."""
    command.succeed(source, "-o", folder / "truth.exr", "--overwrite", "-q", "--integrator", "path", "--spp", spp, "--seed", "9", *SIZE, *flags)
    layers = peers.read_exr(folder / "truth.exr")
    error = layers["StandardError"].mean(axis=2)
    return layers["Combined"], np.sqrt((error**2).sum()) / error.size / layers["Combined"].mean()


def agree(image, path, mean, block):
    """By each channel that has light: means agree within the share `mean`; lit blocks of 6 x 6 pixels within `block`, as a root mean square."""
    told = []
    for a, b in zip(np.moveaxis(image, 2, 0), np.moveaxis(path, 2, 0)):
        if b.mean() < 1e-3 * path.mean():
            assert a.mean() < 1e-3 * image.mean()
            continue
        x, y = (x.reshape(6, 6, 8, 6).mean((1, 3)) for x in (a, b))
        lit = y > 0.1 * y.max()
        told.append((a.mean() / b.mean() - 1, np.sqrt(((x - y)[lit] ** 2).mean()) / y[lit].mean()))
    print(told)
    assert told and all(abs(ratio) < mean and off < block for ratio, off in told), told


# ---------------------------------------------------------------------------------------------------------------- lamps

LAMPS = ["--camera", "0,-6,2.2", "--look-at", "0,0,0.2", "--fov", "36"]


@pytest.mark.parametrize("name", ["point", "spot"])
def test_a_lamp_is_the_same_lamp_in_cycles(cloudvdb, tmp_path, python, name):
    """Its power, colour, size, and of a spot its direction, cone and edge, by the light on the ground."""
    source = lit(tmp_path / "lamp.glb", [{"point": POINT, "spot": SPOT}[name]], balls=False)
    path, error = truth(source, tmp_path, *LAMPS, spp=64)
    assert error < 1e-3
    image = shown(script(source, tmp_path, *LAMPS), samples=32, bounces=2, python=python)["arrays"]["images"][0]
    agree(image, path, 0.003, 0.006)


def test_clouds_between_lamps(cloudvdb, tmp_path, python):
    """Live with the ground; and baked, where lamps light the ground but not the cloud once more."""
    source = lit(tmp_path / "lamps.glb", [POINT, SPOT])
    image = shown(script(source, tmp_path, *LAMPS), samples=150, bounces=64, python=python)["arrays"]["images"][0]
    agree(image, truth(source, tmp_path, *LAMPS, spp=800)[0], 0.02, 0.06)
    source = lit(tmp_path / "lamps.glb", [POINT, SPOT], ground=False)
    image = shown(script(source, tmp_path, *LAMPS, "--bake", "view", "--photons", "600k", "--no-check"), samples=4, python=python)["arrays"]["images"][0]
    agree(image, truth(source, tmp_path, *LAMPS, spp=1500)[0], 0.025, 0.09)


def test_lamps_go_through_a_glb(cloudvdb, tmp_path):
    source = lit(tmp_path / "lamps.glb", [POINT, SPOT])
    command.succeed(source, "-o", tmp_path / "regions.glb", "-q", *SIZE)
    pictures = [truth(path, tmp_path, *LAMPS, spp=16)[0] for path in (source, tmp_path / "regions.glb")]
    # The same random numbers: only rounding differs, which here and there turns a path aside.
    assert np.median(np.abs(pictures[1] - pictures[0])) < 1e-4 * pictures[0].mean()
    assert pictures[1].mean() == pytest.approx(pictures[0].mean(), rel=0.02)


# ----------------------------------------------------------------------------------------------------------------- fire

VIEW = ["--camera", "0,-5.2,0.2", "--look-at", "0,0,0", "--fov", "30", "--sigma-t", "4", "--albedo", "0.8", "-g", "0.4"]
FIRES = {"flame": ["--emission", "flame=6,2,0.4"], "heat": ["--temperature", "temperature=1500"]}


@pytest.fixture(scope="module")
def burning(tmp_path_factory):
    """Smoke above a flame that is partly outside of it."""
    x, y, z = np.mgrid[0:32, 0:32, 0:32] / 15.5 - 1.0
    away = np.sqrt(x**2 + y**2 + 0.3 * (z + 0.4) ** 2)
    smoke = np.clip(1.3 - 1.4 * np.sqrt(x**2 + y**2 + (z - 0.2) ** 2), 0, None)
    return vdbinfo.write_values(tmp_path_factory.mktemp("fire") / "fire.vdb", smoke, 2 / 31, (-1.0,) * 3,
                                flame=np.clip(1.0 - 2.5 * away, 0, None), temperature=np.clip(1.2 - away, 0, None))


def test_a_fire_in_cycles(cloudvdb, tmp_path, python, burning):
    """Of one colour: its own light and what it sends through scattering, baked and live."""
    path, error = truth(burning, tmp_path, *VIEW, *FIRES["flame"], spp=400)
    assert error < 3e-3
    baked = script(burning, tmp_path, *VIEW, *FIRES["flame"], "--bake", "view", "--photons", "400k", "--no-check")
    agree(shown(baked, python=python)["arrays"]["images"][0], path, 0.015, 0.05)
    agree(shown(baked, samples=100, bounces=64, live=True, python=python)["arrays"]["images"][0], path, 0.02, 0.05)


@pytest.mark.long
def test_a_fire_in_eevee(cloudvdb, tmp_path, python, burning):
    path, _ = truth(burning, tmp_path, *VIEW, *FIRES["flame"], spp=400)
    baked = script(burning, tmp_path, *VIEW, *FIRES["flame"], "--bake", "view", "--photons", "400k", "--no-check")
    agree(shown(baked, samples=16, eevee=True, python=python)["arrays"]["images"][0], path, 0.035, 0.07)


def test_heat_in_cycles(cloudvdb, tmp_path, burning):
    """A black body, whose colour differs from place to place, from two sides by one bake; the check of the bake sees it too."""
    made = script(burning, tmp_path, "-o", tmp_path / "cloud.json", *VIEW, *FIRES["heat"], "--bake", "sh2", "--photons", "400k")
    told = json.loads((tmp_path / "cloud.json").read_text())
    assert {grid["name"] for grid in told["vdb"]["emission"]} == {"emission_red", "emission_green"}
    own = told["bake"]["errors"]
    assert all(abs(one["mean"]) < 0.02 + 3 * one["mean_se"] and one["rms"] < 0.12 for one in own)
    place = (5.2, 0.01, 0.2)
    path, _ = truth(burning, tmp_path, *FIRES["heat"], "--camera", "5.2,0.01,0.2", "--look-at", "0,0,0.2", *VIEW[4:], spp=400)
    agree(shown(made, places=[place])["arrays"]["images"][0], path, 0.02, 0.08)


def test_emission_grids_hold_what_shines(cloudvdb, tmp_path, burning):
    """Their integral is the power over 4 pi, whatever the voxels; they stay in the lattice of the input, and can be left out."""
    before = vdbinfo.read(burning)["grids"]["flame"]
    for size in ((), ("--voxel-size", 0.1)):
        command.succeed(burning, "-o", tmp_path / "cloud.vdb", "--overwrite", "-q", *FIRES["flame"], *size)
        grid = vdbinfo.read(tmp_path / "cloud.vdb")["grids"]["emission"]
        assert float(grid["metadata"]["emission_scale"]) * grid["integral"] == pytest.approx(6.0 * before["integral"], rel=2e-3)
        assert [float(c) for c in grid["metadata"]["emission_tint"].split()] == pytest.approx([1, 1 / 3, 0.2 / 3])
        assert 0.8 < grid["max"] < 1.001 and (grid["axes"] == before["axes"]) == (not size)
    command.succeed(burning, "-o", tmp_path / "cloud.vdb", "--overwrite", "-q", *FIRES["flame"], "--effect", "emission=off")
    assert "emission" not in vdbinfo.read(tmp_path / "cloud.vdb")["grids"]
