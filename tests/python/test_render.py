"""The path tracer against what nobody here wrote: Cycles' pictures, published tables of slabs, and identities.

Pictures are small and judged by the noise of both (ztest.py); scenes go through peers.py.
"""
import math

import numpy as np
import pytest

import cumulus
import gltf
import peers
import vdbinfo
import ztest
from layouts import three_balls
from peers import ball, described
from ztest import Picture, compare, rim

# ------------------------------------------------------------------------------------------------- pictures by Cycles

TWO = [ball((-0.5, 0.1, 0.3), 0.8, 6.0, 0.95, 0.6), ball((0.45, -0.2, 0.0), 0.7, 9.0, 0.99, 0.3)]
GROUND = {"z": -0.9, "albedo": 0.6}
SPHERES = {
    "one, in the sun": described(balls=[ball((0.1, -0.2, 0.3), 0.9, 6.0, 0.95, 0.6)]),
    "two that overlap, sun and sky": described(balls=TWO, sky=0.3),
    "two above a ground, sun": described(balls=TWO, ground=GROUND),
    "two above a ground, sun and sky": described(balls=TWO, ground=GROUND, sky=0.3),
    "dense and forward, under the sky": described(balls=[ball((0.0, 0.0, 0.2), 1.0, 12.0, 0.999, 0.85)], sun=None, sky=1.0),
    "one that scatters back, a wide sun": described(balls=[ball((0.0, 0.0, 0.2), 1.0, 3.0, 0.9, -0.4)], ground=GROUND, sun={"angle": 0.3}),
}
# Left to `make crosscheck`: others have their parts.
MORE = {"two above a ground, sun"}


def of(shots):
    """The picture of cloudvdb's shots: one render has its standard errors."""
    return Picture.from_error(shots.images[0], shots.errors[0])


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.long) if name in MORE else name for name in SPHERES])
def test_spheres_as_cycles_has_them(cloudvdb, tmp_path, name):
    """Homogeneous closed meshes in Cycles, which has no bias there; media that overlap add."""
    scene = SPHERES[name]
    ours = peers.cloudvdb(scene, tmp_path, samples=1024, seeds=[11])
    theirs = peers.cycles(scene, samples=48)
    picture = of(ours)
    verdict = compare(picture, Picture.from_seeds(theirs.images), name, skip=rim(picture) if scene["sky"] == 1.0 else None)
    print(verdict)
    assert verdict.agree, verdict
    assert verdict.error < 0.02, verdict


def small_cumulus(folder, cells=32, sigma=8.0, **options):
    values, voxel, origin = cumulus.values(cells)
    return described(**peers.grid(folder / "cumulus.vdb", values, voxel, origin, sigma=sigma), **options)


@pytest.mark.parametrize("sky", [pytest.param(0.0, marks=pytest.mark.long), 0.3])
def test_grid_as_cycles_has_it(cloudvdb, tmp_path, sky):
    """Cycles 4.5 marches grids, in steps of a fifth of its own size here: 2 % are left to it."""
    scene = small_cumulus(tmp_path, sky=sky)
    ours = peers.cloudvdb(scene, tmp_path, samples=1024, seeds=[12])
    theirs = peers.cycles(scene, samples=32, step_rate=0.2)
    verdict = compare(of(ours), Picture.from_seeds(theirs.images), f"cumulus, sky {sky}", tolerance=0.02)
    print(verdict)
    assert verdict.agree, verdict


def test_grid_above_a_ground(cloudvdb, tmp_path):
    """A glTF with a mesh and a node that names the VDB. Mitsuba has no bias, but a sun without a disc; Cycles marches."""
    scene = small_cumulus(tmp_path, sky=0.3, sun={"angle": 1e-4}, ground={"z": -1.2, "albedo": 0.5})
    ours = peers.cloudvdb(scene, tmp_path, samples=1024, seeds=[13])
    theirs = peers.mitsuba(scene, samples=32) if peers.has_mitsuba() else peers.cycles(scene, samples=32, step_rate=0.2)
    verdict = compare(of(ours), Picture.from_seeds(theirs.images), "cumulus above a ground", tolerance=0.02)
    print(verdict)
    assert verdict.agree, verdict


def test_stated_errors_are_true(cloudvdb, tmp_path):
    """The layer of standard errors against the scatter of 12 seeds."""
    ours = peers.cloudvdb(small_cumulus(tmp_path, sky=0.3, sigma=25.0), tmp_path, samples=48, seeds=12)
    ratio, error = ztest.stated_errors(ours.errors, ours.images, shared=True)
    print(f"variance between seeds over the stated one: {ratio:.3f} +- {error:.3f}")
    assert abs(ratio - 1.0) < 4.0 * error and error < 0.1


def test_layers_add_up(cloudvdb, tmp_path):
    """Before a black sky and without a ground the volume's own layers are the picture."""
    layers = peers.cloudvdb(SPHERES["one, in the sun"], tmp_path, samples=8).layers
    assert np.allclose(layers["VolumeDir"] + layers["VolumeInd"], layers["Combined"], rtol=1e-5, atol=1e-7)
    assert layers["VolumeDir"].max() > 0 and layers["VolumeInd"].max() > 0


def test_threads_change_nothing(cloudvdb, tmp_path):
    scene = small_cumulus(tmp_path, sky=0.3)
    one, two = (peers.cloudvdb(scene, tmp_path, samples=4, seeds=[5], threads=threads).images for threads in (1, 2))
    assert np.array_equal(one, two)


# ---------------------------------------------------------------------------------------------------------- furnaces

def furnace(**media):
    return described(sun=None, sky=1.0, **media)


WHITE = [ball((0.0, 0.0, 0.2), 1.0, 5.0, 1.0, 0.85)]
FURNACES = {
    "ball": lambda folder: furnace(balls=WHITE),
    "overlapping balls": lambda folder: furnace(balls=[*WHITE, ball((0.5, 0.3, 0.4), 0.8, 8.0, 1.0, -0.5), ball((0.1, 0.0, 0.2), 0.3, 30.0, 1.0, 0.0)]),
    "ground of albedo 1": lambda folder: furnace(balls=WHITE, ground={"z": -0.8, "albedo": 1.0}),
    "grid": lambda folder: {**small_cumulus(folder, sigma=25.0, sun=None, sky=1.0), "albedo": 1.0},
}


@pytest.mark.parametrize("name", FURNACES)
def test_furnace(cloudvdb, tmp_path, name):
    """Nothing absorbs and the sky is 1 all round: no pixel tells cloud from sky, whatever the path."""
    ours = peers.cloudvdb(FURNACES[name](tmp_path), tmp_path, samples=16)
    worst = np.abs(ours.images[0] - 1.0).max()
    assert worst <= 1e-5, f"a pixel is off by {worst:.2e}"


# ------------------------------------------------------------------------------------------------------------- fluxes

# Sun from above, no surface: g, albedo, optical depth, reflected, transmitted; by 64-stream discrete ordinates.
SLABS = [
    (0.0, 1.0, 1.0, 0.34133, 0.65867),
    (0.0, 1.0, 8.0, 0.82179, 0.17821),
    (0.75, 1.0, 1.0, 0.07874, 0.92126),
    (0.75, 1.0, 8.0, 0.50641, 0.49357),
    (0.75, 0.9, 2.0, 0.09739, 0.66096),
    (0.85, 1.0, 8.0, 0.35843, 0.64156),
    (0.85, 0.99, 8.0, 0.30215, None),
]
OVERHEAD = ("--sun", "0,0,-1", "--sun-angle", "1e-6")
PARTS = ("up", "down_direct", "down_diffuse", "absorbed_medium", "absorbed_surface")


def slab(folder, g, albedo, tau):
    """200 m thick, without end."""
    sigma = tau / 200.0
    medium = {"shape": "slab", "half_height": 100.0, "sigma_s": sigma * albedo, "sigma_a": sigma * (1 - albedo), "g": g}
    deck = {"name": "Deck", "translation": [0, 500, 0], "extras": {"cloudvdb": medium}}
    return gltf.scene(folder / "slab.gltf", deck, meshes=False), ()


def layers(folder, g, albedo, tau):
    """The same slab as a tile of voxels: layers that differ ten times in density, so that majorants do. Linear
    interpolation keeps the sum of the samples, so the optical depth is exact."""
    profile = np.array([1.0, 10.0, 1.0, 4.0, 10.0, 10.0, 1.0, 1.0] * 3)
    voxel = 200.0 / len(profile)
    path = vdbinfo.write_values(folder / "slab.vdb", np.broadcast_to(profile, (8, 8, len(profile))), voxel, (0.0, 0.0, 400.0))
    medium = ("--sigma-t", repr(tau / (profile.sum() * voxel)), "--albedo", albedo, "-g", g)
    return path, ("--periodic", "xy", *medium)


def balance(found):
    """Every part within 0 and 1, and all of them the whole."""
    assert set(PARTS) <= set(found), sorted(found)
    assert sum(found[part][0] for part in PARTS) == pytest.approx(1.0, abs=1e-6)
    assert all(-1e-9 <= found[part][0] <= 1 + 1e-9 for part in PARTS), found
    assert found["absorbed_surface"][0] == 0


def within(found, quantity, expected, limit, slack=5e-6):
    """`slack`: the digits of the table."""
    value, error = found
    assert error <= limit, f"{quantity}: the standard error is {error:.1e}"
    assert abs(value - expected) <= 3.5 * error + slack, f"{quantity} is {value:.5f} +- {error:.5f}, expected {expected:.5f}"


def check_slab(folder, how, row, limit):
    g, albedo, tau, reflected, transmitted = row
    scene, options = how(folder, g, albedo, tau)
    # As many photons as a fraction of that size asks for.
    worst = max(p * (1 - p) for p in (reflected, transmitted) if p is not None)
    found = peers.flux(scene, *OVERHEAD, *options, "--photons", math.ceil(1.2 * worst / limit ** 2), "--seed", 3)
    balance(found)
    within(found["up"], "up", reflected, limit)
    direct, diffuse = found["down_direct"], found["down_diffuse"]
    # Light that met nothing, by Beer's law.
    assert abs(direct[0] - math.exp(-tau)) <= 3.5 * direct[1] + 1e-6, direct
    if transmitted is not None:
        # The two are counts of different photons of one run: their errors do not add to more than this.
        total = direct[0] + diffuse[0], math.sqrt(max(transmitted * (1 - transmitted) / (1.2 * worst), 0.0)) * limit
        within(total, "down", transmitted, limit)
    if albedo == 1:
        assert abs(found["absorbed_medium"][0]) < 1e-9


@pytest.mark.parametrize("how", [slab, layers])
@pytest.mark.parametrize("row", SLABS, ids=lambda row: f"g{row[0]:g}-albedo{row[1]:g}-tau{row[2]:g}")
def test_slabs_of_the_tables(cloudvdb, tmp_path, how, row):
    check_slab(tmp_path, how, row, limit=5e-4)


@pytest.mark.long
@pytest.mark.parametrize("how", [slab, layers])
@pytest.mark.parametrize("row", SLABS, ids=lambda row: f"g{row[0]:g}-albedo{row[1]:g}-tau{row[2]:g}")
def test_slabs_closely(cloudvdb, tmp_path, how, row):
    check_slab(tmp_path, how, row, limit=3e-4)


def step_cloud(folder, fine=8):
    """The radiation-code intercomparison's (I3RC, phase 1): 32 columns of 15.625 m, 16 of optical depth 2, then 16 of 18,
    250 m thick, without end along y. `fine` voxels a column: interpolation smears the step over one."""
    voxel = 15.625 / fine
    columns = np.repeat([2.0, 18.0], 16 * fine) / 250.0
    values = np.broadcast_to(columns[:, None, None], (32 * fine, 4, 16 * fine))
    return vdbinfo.write_values(folder / "step.vdb", values, voxel, (0.5 * voxel, 0.5 * voxel, 0.5 * voxel))


@pytest.mark.parametrize("limit", [4.5e-4, pytest.param(2e-4, marks=pytest.mark.long)])
def test_step_cloud(cloudvdb, tmp_path, limit):
    found = peers.flux(step_cloud(tmp_path), *OVERHEAD, "--periodic", "xy", "--sigma-t", 1, "--albedo", 1, "-g", 0.85,
                       "--photons", math.ceil(0.25 / limit ** 2), "--seed", 4)
    balance(found)
    print(found)
    assert found["up"][1] <= limit
    assert found["up"][0] == pytest.approx(0.3276, abs=0.0015)
    assert found["down_direct"][0] + found["down_diffuse"][0] == pytest.approx(0.6724, abs=0.0015)


def test_energy_of_a_layout(cloudvdb, tmp_path):
    """Balls that absorb, with and without a ground: all that comes is accounted for."""
    found = peers.flux(three_balls(tmp_path / "three.glb"), "--photons", "20000")
    balance(found)
    assert found["absorbed_medium"][0] > 0 and found["up"][0] > 0
    scene = described(balls=TWO, ground=GROUND)
    found = peers.flux(peers.layout(scene, tmp_path / "ground.glb"), "--photons", "20000", "--sun", "0.8,0.4,-0.6")
    assert sum(found[part][0] for part in PARTS) == pytest.approx(1.0, abs=1e-6)
    assert found["absorbed_surface"][0] > 0
