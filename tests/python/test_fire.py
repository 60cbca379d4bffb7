"""What shines by itself, as files and flags say it: closed forms of thin and of thick flames, and what is refused."""
import json

import numpy as np
import pytest

import command
import gltf
import peers
import vdbinfo

SIDE, CELLS = 2.0, 20
VOXEL = SIDE / CELLS
LOOK = ["--camera", "0,-12,0", "--look-at", "0,0,0", "--size", "8x6", "-q", "--density", "source"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fire")


@pytest.fixture(scope="module")
def burning(folder):
    """A cube of smoke, even, with a flame of half a sample in all of it, as hot as 2 x its scale."""
    ones = np.ones((CELLS,) * 3)
    corner = (-SIDE / 2 + VOXEL / 2,) * 3
    return vdbinfo.write_values(folder / "burning.vdb", ones, VOXEL, corner, flame=0.5 * ones, temperature=2.0 * ones)


def seen(source, folder, *flags, integrator="path", fov=4):
    """The mean of a picture of the middle, RGB."""
    target = folder / "seen.exr"
    command.succeed(source, "-o", target, "--overwrite", "--integrator", integrator, "--fov", str(fov),
                    "--spp", "900" if integrator == "path" else "16", *LOOK, *map(str, flags))
    return peers.read_exr(target)["Combined"].mean(axis=(0, 1))


def along(per_metre, sigma_t):
    """Emission seen through the cube, whose samples fall to 0 within half a voxel of its faces: its depth is its side."""
    return per_metre * (1 - np.exp(-sigma_t * SIDE)) / sigma_t


@pytest.mark.parametrize("integrator", ["path", "grid", "photon"])
@pytest.mark.parametrize("sigma_t", [1e-6, 0.8])
def test_a_flame_without_scattering_is_its_closed_form(cloudvdb, burning, folder, integrator, sigma_t):
    light = seen(burning, folder, "--sigma-t", sigma_t, "--albedo", 0, "--emission", "flame=3,1,0.25", "--photons", "1000", integrator=integrator)
    # Rays of two degrees are longer by less than a thousandth.
    assert light == pytest.approx(along(0.5 * np.array([3, 1, 0.25]), sigma_t), rel=2e-3 if integrator != "path" or sigma_t < 0.1 else 2e-2)


def test_heat_in_the_mediums_own_absorption_is_a_black_body(cloudvdb, burning, folder):
    """Kirchhoff: what is opaque and does not scatter has a black body's radiance, whatever it is made of; thin, its share."""
    thick = seen(burning, folder, "--sigma-t", 40, "--albedo", 0, "--temperature", "temperature=1500", integrator="grid")
    # Planck's law at 3000 K in the luminance of CIE 1931 (V(lambda) as a table of 20 nm), W m^-2 sr^-1.
    wavelength = np.arange(400, 721, 20) * 1e-9
    eye = np.array([4e-4, .004, .023, .06, .139, .323, .71, .954, .995, .87, .631, .381, .175, .061, .017, .0041, .00105])
    planck = 2 * 6.62607015e-34 * 299792458**2 / wavelength**5 / np.expm1(6.62607015e-34 * 299792458 / (wavelength * 1.380649e-23 * 3000))
    luminance = (planck * eye).sum() * 20e-9
    assert thick @ [0.2126, 0.7152, 0.0722] == pytest.approx(luminance, rel=0.02)
    assert thick[0] > 1.5 * thick[1] > 3 * thick[2] > 0
    thin = seen(burning, folder, "--sigma-t", 0.1, "--albedo", 0.5, "-g", 0, "--temperature", "temperature=1500", "--effect",
                "multiple_scattering=off", integrator="grid")
    # Half of what is taken is scattered, once at most: a little more than what comes straight.
    straight = along(0.05 * thick, 0.1)
    assert np.all(thin > straight) and np.all(thin < 1.1 * straight)


def test_soot_glows_where_the_medium_does_not(cloudvdb, burning, folder):
    own = seen(burning, folder, "--sigma-t", 0.5, "--albedo", 0, "--temperature", "temperature=1000", integrator="grid")
    soot = seen(burning, folder, "--sigma-t", 0.5, "--albedo", 0, "--temperature", "temperature=1000", "--soot", 1.5, integrator="grid")
    assert soot == pytest.approx(3 * own, rel=1e-4)


def test_nodes_say_how_they_shine(cloudvdb, burning, folder):
    """A ball by its extras, a material's too; a VDB that a node names and moves; the scene is lit by them alone."""
    plain = gltf.scene(folder / "ball.gltf", gltf.ball("Fire", (0, 0, 0), 1.0, sigma_t=1e-6, albedo=0.0, emission=[2, 1, 0.5]), sun=False)
    light = seen(plain, folder, fov=0.2)
    assert light == pytest.approx(2 * np.array([2, 1, 0.5]), rel=1e-3)
    ran = command.succeed(plain, "--json", "--dry-run")
    assert "what shines is the light" in ran.out
    moved = gltf.volume("burning.vdb", sigma_t=0.8, albedo=0.0, emission_grid="flame", emission=[3, 1, 0.25])
    moved["translation"] = [0.0, 0.0, 0.3]
    light = seen(gltf.scene(folder / "named.gltf", moved, sun=False), folder, integrator="grid")
    assert light == pytest.approx(along(0.5 * np.array([3, 1, 0.25]), 0.8), rel=2e-3)


def test_the_plan_knows_fire(cloudvdb, burning):
    told = json.loads(command.succeed("plan", burning, "--json", "--emission", "flame=1", "--sigma-t", "1").out)
    (emission,) = [e for e in told["effects"] if e["name"] == "emission"]
    # 4 pi times half a sample over 8 cubic metres.
    assert emission["on"] and emission["figure"] == pytest.approx(4 * np.pi * 0.5 * SIDE**3, rel=1e-6)
    off = json.loads(command.succeed("plan", burning, "--json", "--emission", "flame=1", "--effect", "emission=off").out)
    assert [e["on"] for e in off["effects"] if e["name"] == "emission"] == [False]


@pytest.mark.parametrize("flags, code, says", [
    (["--emission", "fire=1"], 1, ["fire", "burning.vdb", "flame"]),
    (["--emission", "flame"], 2, ["flame=5"]),
    (["--emission", "flame=0"], 2, ["not all 0"]),
    (["--temperature", "temperature=-3"], 2, ["kelvins"]),
    (["--soot", "1"], 2, ["--temperature"]),
    (["--emission", "flame=1", "--periodic", "xy"], 1, ["goes on without end", "--periodic"]),
])
def test_what_is_refused(cloudvdb, burning, folder, flags, code, says):
    command.refuse(burning, "-o", folder / "no.exr", *flags, code=code, says=says)


def test_layouts_say_it_themselves(cloudvdb, folder):
    ball = gltf.scene(folder / "quiet.gltf", gltf.ball("Fire", (0, 0, 0), 1.0, sigma_t=1.0))
    command.refuse(ball, "-o", folder / "no.exr", "--temperature", "temperature=1000", code=2, says=["extras.cloudvdb", "quiet.gltf"])
    for wrong, says in (({"emission": -1}, "not below 0"), ({"temperature": "hot"}, "a finite number"), ({"soot": -2}, "not below 0")):
        path = gltf.scene(folder / "wrong.gltf", gltf.ball("Fire", (0, 0, 0), 1.0, sigma_t=1.0, **wrong))
        command.refuse(path, "-o", folder / "no.exr", says=["Fire", says])
    slab = gltf.ball("Layer", (0, 0, 0), 1.0, sigma_t=1.0, shape="slab", half_height=1.0, emission=1)
    command.refuse(gltf.scene(folder / "slab.gltf", slab), "-o", folder / "no.exr", says=["Layer", "goes on without end"])
    named = gltf.volume("burning.vdb", sigma_t=1.0, temperature_grid="temperature")
    command.refuse(gltf.scene(folder / "unsaid.gltf", named), "-o", folder / "no.exr", says=["extras.cloudvdb.temperature", "missing"])
