"""Light baked beside the density: Cycles shows, without one bounce, what the path tracer shows."""
import json

import numpy as np
import pytest

import command
import cumulus
import peers
import vdbinfo
from bakes import shown
from blender import blender

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
    # Noise of so few photons is 4 to 8 % in blocks, by the seed.
    agree(found["arrays"]["images"][0], path, error, 0.02, 0.1)
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
    assert {grid["name"] for grid in report["bake"]["grids"]} == {"sunlight", "glow", "flow", "flow_x", "flow_y", "flow_z", *(f"light_{i}" for i in range(16))}
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


def test_a_bake_may_go_unchecked(cloud, tmp_path):
    _, checked = baked(cloud, tmp_path, "view", photons="20k")
    before = vdbinfo.read(tmp_path / "view.vdb"), (tmp_path / "view.vdb").read_bytes()
    _, unchecked = baked(cloud, tmp_path, "view", "--no-check", photons="20k")
    assert len(checked["bake"].pop("errors")) == 3 and unchecked["bake"].pop("errors") == []
    assert checked["bake"] == unchecked["bake"]
    # The same file, but that it says nothing of an error that nobody looked at.
    after = vdbinfo.read(tmp_path / "view.vdb"), (tmp_path / "view.vdb").read_bytes()
    assert float(before[0]["metadata"].pop("light_error")) > 0 and before[0] == after[0]
    half = len(after[1]) // 2
    assert before[1][-half:] == after[1][-half:]


#: The group of the baked light on the inside of a ball around the camera, whose attributes are the grids' samples.
GROUP = """
import importlib, sys, types
# The add-on's modules without the add-on.
package = types.ModuleType("package")
package.__path__ = [given["addon"]]
sys.modules["package"] = package
baked = vars(importlib.import_module("package.baked"))
start()
ball = ico("Ball", 10.0, subdivisions=3)
for name, value in given["samples"].items():
    numbers = ball.data.attributes.new(name, "FLOAT", "POINT").data
    numbers.foreach_set("value", np.full(len(numbers), value, np.float32))
material = bpy.data.materials.new("Light")
tree = baked["Tree"].of(material)
light, emission, end = (tree.node(f"ShaderNode{kind}") for kind in ("Group", "Emission", "OutputMaterial"))
light.node_tree = baked["group"]("x", given["cloud"])
light.inputs[0].default_value = 1.0
tree.put(light.outputs[0], emission.inputs[0])
tree.put(emission.outputs[0], end.inputs[0])
ball.data.materials.append(material)
eye = camera((0, 0, 0), (0, 1, 0), angle=1.5)
images = []
for frame, way in given["shots"]:
    bpy.context.scene.frame_set(frame)
    eye.rotation_euler = Vector(way).to_track_quat("-Z", "Y").to_euler()
    settings(16, 16, 1)
    bpy.context.scene.cycles.filter_width = 0.01
    images.append(shoot()[..., 0])
    bpy.context.view_layer.update()
arrays["images"], arrays["turns"] = np.array(images), np.array([Vector(way).to_track_quat("-Z", "Y").to_matrix() for _, way in given["shots"]])
"""


@pytest.mark.parametrize("kind, moves", [("sh2", False), ("sh2", True), ("sh1", False)])
def test_the_shader_says_what_the_grids_mean(kind, moves):
    """The formula of the crate's documentation, by other words."""
    count, sun, scale, g = {"sh1": 4, "sh2": 16}[kind], np.array((0.8, 0.4, -0.6)) / np.sqrt(1.16), 3.0, 0.85
    samples = {"sunlight": 0.4, "glow": 1.5, "flow": 0.7, "flow_x": 0.2, "flow_y": -0.3, "flow_z": 0.15, **{f"light_{i}": v for i, v in enumerate((6.0, 0.3, -0.5, 0.2, 0.1, -0.2, 0.3, 0.1, -0.1, 0.2, -0.1, 0.15, 0.1, -0.2, 0.1, 0.25)[:count])}}
    grids = {name.removeprefix("light_").replace("flow_", "flow"): name for name in samples}
    lobes = {1: 0.5, 2: 0.6} if moves else {1: 0.5}
    part = {"light": "all", "scale": scale, "tint": [1, 1, 1], "glow": 0.5, "grids": grids,
            "frames": [(f, {"scale": scale * f, "glow": h}) for f, h in lobes.items()] if moves else []}
    cloud = {"sun": {"direction": list(sun)}, "bake": {"bake": kind, "g": g, "parts": [part]}}
    shots = [(frame, way) for frame in lobes for way in ((1, 0, 0), (-1, 0.2, -0.3), (0, -1, 1))]
    found = blender(GROUP, addon=str(command.ROOT / "blender_addon"), samples=samples, cloud=cloud, shots=shots)["arrays"]
    at = ((np.arange(16) + 0.5) / 8 - 1) * np.tan(0.75)
    x, y = np.meshgrid(at, -at)
    rays = np.stack([x, y, -np.ones_like(x)], axis=2) / np.sqrt(1 + x**2 + y**2)[..., None]

    def lobe(g, c):
        return (1 - g * g) / (1 + g * g - 2 * g * c) ** 1.5 / (4 * np.pi)

    for (frame, _), turn, image in zip(shots, found["turns"], found["images"]):
        outward = -rays @ turn.T
        h, c = lobes[frame], outward @ sun
        x, y, z = np.moveaxis(outward, 2, 0)
        harmonics = [np.sqrt(1 / (4 * np.pi)) + 0 * x, *(np.sqrt(3 / (4 * np.pi)) * a for a in (y, z, x)),
                     *(np.sqrt(15 / (4 * np.pi)) * a for a in (x * y, y * z)), np.sqrt(5 / (16 * np.pi)) * (3 * z * z - 1),
                     np.sqrt(15 / (4 * np.pi)) * x * z, np.sqrt(15 / (16 * np.pi)) * (x * x - y * y),
                     np.sqrt(35 / (32 * np.pi)) * y * (3 * x * x - y * y), np.sqrt(105 / (4 * np.pi)) * x * y * z,
                     np.sqrt(21 / (32 * np.pi)) * y * (5 * z * z - 1), np.sqrt(7 / (16 * np.pi)) * (5 * z**3 - 3 * z),
                     np.sqrt(21 / (32 * np.pi)) * x * (5 * z * z - 1), np.sqrt(105 / (16 * np.pi)) * z * (x * x - y * y),
                     np.sqrt(35 / (32 * np.pi)) * x * (x * x - 3 * y * y)]
        flow = np.array([samples[f"flow_{axis}"] for axis in "xyz"])
        mean = np.linalg.norm(flow) / samples["flow"]
        wanted = samples["sunlight"] * lobe(g, c) + samples["glow"] * lobe(h, c) + sum(samples[f"light_{i}"] * harmonics[i] for i in range(count))
        wanted = wanted + samples["flow"] * lobe(mean, outward @ flow / np.linalg.norm(flow))
        assert wanted.min() > 0 and wanted.max() > 1.1 * wanted.min()
        np.testing.assert_allclose(image, wanted * scale * (frame if moves else 1), rtol=2e-3)


@pytest.mark.parametrize("arguments, says", [
    (["-o", "a.vdb", "--no-check"], ["--no-check", "--bake"]),
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
