"""Light baked beside the density: Cycles shows, without one bounce, what the path tracer shows."""
import json

import numpy as np
import pytest

import command
import cumulus
import peers
from bakes import shown

MEDIUM = ["--sigma-t", "8", "--albedo", "0.999", "-g", "0.85"]
VIEW = ["--camera", "0,-5.2,0.2", "--look-at", "0,0,0.2", "--fov", "43", "--sun", "0.8,0.4,-0.6", "--irradiance", "3", "--size", "48x36"]


@pytest.fixture(scope="module")
def cloud(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bake")
    values, voxel, origin = cumulus.values(32)
    return peers.grid(folder / "cloud.vdb", values, voxel, origin)["vdb"]


def baked(cloud, folder, bake, *more, photons="200k", view=VIEW):
    """The script and the report of a bake."""
    script, report = folder / f"{bake}.blend.py", folder / f"{bake}.json"
    command.succeed(cloud, "-o", folder / f"{bake}.vdb", "-o", script, "-o", report, "--overwrite", "-q", "--bake", bake, "--photons", photons,
                    *MEDIUM, *view, *more)
    return script, json.loads(report.read_text())


def truth(cloud, folder, *more, view=VIEW, spp=300):
    """The path tracer's picture, and the standard error of its mean."""
    target = folder / "truth.exr"
    command.succeed(cloud, "-o", target, "--overwrite", "-q", "--integrator", "path", "--spp", spp, "--seed", "9", *MEDIUM, *view, *more)
    layers = peers.read_exr(target)
    error = layers["StandardError"].astype(float)
    return layers["Combined"].astype(float), np.sqrt((error.mean(axis=2) ** 2).sum()) / error[..., 0].size


def blocks(image, k=6):
    h, w = image.shape[:2]
    return image.reshape(h // k, k, w // k, k, -1).mean((1, 3, 4))


def agree(image, path, error, mean, block):
    """The means agree within 3 standard errors and the share `mean`; blocks of 6 pixels within the share `block`, as a root mean square."""
    assert abs(image.mean() - path.mean()) < 3 * error + mean * path.mean(), (image.mean(), path.mean(), error)
    a, b = blocks(image), blocks(path)
    lit = b > 0.1 * b.max()
    assert np.sqrt(((a - b)[lit] ** 2).mean()) < block * b[lit].mean()


def test_cycles_shows_a_view_bake_without_a_bounce(cloud, tmp_path):
    script, report = baked(cloud, tmp_path, "view")
    path, error = truth(cloud, tmp_path)
    found = shown(script)
    agree(found["arrays"]["images"][0], path, error, 0.02, 0.07)
    assert found["things"] == ["CAMERA", "LIGHT", "VOLUME"] and found["size"] == [48, 36]
    assert found["live"] == pytest.approx([0.85, 8.0])
    # What the report says of it holds.
    own = report["bake"]["errors"][0]
    assert own["turned"] == 0 and abs(own["mean"]) < 3 * own["mean_se"] + 0.02
    # From elsewhere it is wrong, and that is told.
    assert max(abs(e["mean"]) for e in report["bake"]["errors"][1:]) > 0.2


def test_the_live_cloud_is_one_value_away(cloud, tmp_path):
    script, _ = baked(cloud, tmp_path, "view", photons="20k")
    path, error = truth(cloud, tmp_path)
    found = shown(script, samples=48, bounces=64, live=True)["arrays"]["images"][0]
    # Blender 4.5 marches, and is some per cent off.
    assert abs(found.mean() / path.mean() - 1) < 0.08


def test_any_view_is_seen_from_anywhere(cloud, tmp_path):
    script, report = baked(cloud, tmp_path, "sh2")
    assert {grid["name"] for grid in report["bake"]["grids"]} == {"sunlight", "glow", *(f"light_{i}" for i in range(9))}
    places = [(5.2, 0.01, 0.2), (-3.7, -3.7, 0.2)]
    images = shown(script, places=places)["arrays"]["images"]
    for place, image in zip(places, images):
        view = ["--camera", ",".join(map(str, place)), *VIEW[2:]]
        path, error = truth(cloud, tmp_path, view=view)
        agree(image, path, error, 0.12, 0.25)


def test_sun_and_sky_have_grids_and_factors_of_their_own(cloud, tmp_path):
    sky = ["--sky", "0.1,0.3,0.9"]
    script, report = baked(cloud, tmp_path, "view", *sky)
    assert {grid["name"] for grid in report["bake"]["grids"]} == {"light_sun", "light_sky"}
    path, error = truth(cloud, tmp_path, *sky)
    whole, sunless = (shown(script, factors=factors)["arrays"]["images"][0] for factors in ({}, {"Sun": 0.0}))
    agree(whole, path, error, 0.02, 0.07)
    blue = path[..., 2].mean() / path[..., 0].mean()
    assert whole[..., 2].mean() / whole[..., 0].mean() == pytest.approx(blue, rel=0.05)
    dark, _ = truth(cloud, tmp_path, *sky, view=[*VIEW[:-4], "--irradiance", "0", *VIEW[-2:]])
    assert sunless.mean() == pytest.approx(dark.mean(), rel=0.04)


def test_the_same_seed_bakes_the_same_bytes(cloud, tmp_path):
    files = []
    for threads in (1, 3):
        baked(cloud, tmp_path, "sh1", "--threads", threads, photons="20k")
        files.append([(tmp_path / f"sh1.{end}").read_bytes() for end in ("vdb", "blend.py")])
    assert files[0] == files[1]


def test_a_file_can_be_as_small_as_asked(tmp_path):
    values, voxel, origin = cumulus.values(80)
    cloud = peers.grid(tmp_path / "cloud.vdb", values, voxel, origin)["vdb"]
    _, whole = baked(cloud, tmp_path, "sh1", photons="20k")
    before = (tmp_path / "sh1.vdb").stat().st_size
    _, small = baked(cloud, tmp_path, "sh1", "--max-mb", before / 1.6e6, photons="20k")
    assert (tmp_path / "sh1.vdb").stat().st_size <= before / 1.6
    assert small["vdb"]["voxel_size"] > 1.1 * whole["vdb"]["voxel_size"] and any("--max-mb" in note for note in small["notes"])


def test_doctor_knows_baked_light(cloud, tmp_path):
    baked(cloud, tmp_path, "isotropic", photons="20k")
    told = json.loads(command.succeed("doctor", tmp_path / "isotropic.vdb", "--json").out)
    assert told["healthy"] and "baked-light" in [finding["id"] for finding in told["findings"]]
    assert [grid["name"] for grid in told["grids"]] == ["density", "light"]


@pytest.mark.parametrize("arguments, says", [
    (["-o", "a.png", "--bake", "view"], ["--bake", "-o cloud.vdb"]),
    (["-o", "a.blend.py"], [".vdb", "beside"]),
    (["-o", "a.vdb", "-o", "a.blend.py", "--up", "y"], ["--up y"]),
    (["-o", "a.vdb", "--bake", "sh2", "--up", "y"], ["--up y", "view"]),
    (["-o", "a.vdb", "--bake", "view", "--grids", "source"], ["density", "--grids"]),
    (["-o", "a.vdb", "--bake", "view", "--periodic", "xy"], ["without end", "--bake"]),
    (["-o", "a.vdb", "--max-mb", "0"], ["max-mb"]),
    (["-o", "a.vdb", "--max-mb", "1", "--voxel-size", "0.1"], ["--voxel-size"]),
])
def test_what_cannot_be_baked_is_refused_with_a_sentence(cloud, tmp_path, arguments, says):
    command.refuse(cloud, *arguments, *MEDIUM, code=2, says=says, folder=tmp_path, cwd=tmp_path)
