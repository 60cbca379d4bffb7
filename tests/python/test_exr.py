"""The picture as OpenEXR is what Blender shows, pass by pass, and what OpenEXR's own library reads."""
import OpenEXR
import numpy as np
import pytest

from blender import blender

WIDTH, HEIGHT = 32, 24
LIGHT = ("VolumeDir", "VolumeInd", "Surface", "Env")
COLOURS = ("", *(f"{name}." for name in LIGHT), "StandardError.")
CHANNELS = {f"{layer}{c}" for layer in COLOURS for c in "RGB"} | {"A", "Transmittance.X", "Depth.Z"}

# The compositor's Image node has a socket for each pass; each is rendered into a file of its own.
SHOW = """
import OpenEXR
scene = start()
image = bpy.data.images.load(given["path"])
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *given["size"], 100
scene.render.engine = "CYCLES"
scene.cycles.samples = 1
camera()
scene.use_nodes = True
tree = scene.node_tree
tree.nodes.clear()
node, end = tree.nodes.new("CompositorNodeImage"), tree.nodes.new("CompositorNodeComposite")
node.image = image
# Which kind it is Blender knows once somebody asks for its passes.
out["type"] = image.type
out["layers"] = node.has_layers
out["sockets"] = {socket.name: socket.type for socket in node.outputs if socket.enabled}
scene.view_settings.view_transform = "Raw"
settings = scene.render.image_settings
settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
for name in out["sockets"]:
    tree.links.new(node.outputs[name], end.inputs["Image"])
    scene.render.filepath = os.path.join(bpy.app.tempdir, "pass.exr")
    bpy.ops.render.render(write_still=True)
    with OpenEXR.File(scene.render.filepath, separate_channels=True) as file:
        arrays[name] = np.stack([file.channels()[c].pixels for c in "RGBA"])
"""


@pytest.fixture(scope="module")
def path(cloudvdb, scenes, tmp_path_factory):
    path = tmp_path_factory.mktemp("exr") / "a.exr"
    cloudvdb.succeed(scenes / "two_spheres.gltf", "--density", "source", "--spp", "4", "--size", f"{WIDTH}x{HEIGHT}", "-o", path)
    return path


@pytest.fixture(scope="module")
def picture(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 1
        return dict(file.header()), {name: channel.pixels for name, channel in file.channels().items()}


@pytest.fixture(scope="module")
def shown(path):
    return blender(SHOW, path=str(path), size=(WIDTH, HEIGHT))


def layer(channels, name):
    return np.stack([channels[f"{name}.{c}" if name else c] for c in "RGB"])


def test_openexr_reads_every_channel(picture):
    header, channels = picture
    assert set(channels) == CHANNELS
    assert all(c.shape == (HEIGHT, WIDTH) and c.dtype == np.float32 for c in channels.values())
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION and header["pixelAspectRatio"] == 1.0
    assert header["software"].startswith("cloudvdb ") and "one sigma" in header["comments"]


def test_the_light_is_the_sum_of_its_layers(picture):
    _, channels = picture
    assert layer(channels, "") == pytest.approx(sum(layer(channels, name) for name in LIGHT), rel=1e-6, abs=1e-9)
    assert (layer(channels, "") > 0).any()


def test_the_standard_error_is_finite_and_positive_where_there_is_light(picture):
    _, channels = picture
    error, light = layer(channels, "StandardError"), layer(channels, "")
    assert np.isfinite(error).all() and (error >= 0).all()
    volume = (layer(channels, "VolumeDir") + layer(channels, "VolumeInd") > 0) & (light > 0)
    assert volume.any() and (error[volume] > 0).all()


def test_shares_are_shares(picture):
    _, channels = picture
    for name in ("A", "Transmittance.X"):
        assert (channels[name] >= 0).all() and (channels[name] <= 1).all(), name
    assert (channels["Depth.Z"] > 0).all()


def test_blender_has_a_socket_for_each_pass(shown):
    assert shown["type"] == "MULTILAYER"
    # One layer, the one without a name: no menu stands between the artist and the passes.
    assert not shown["layers"]
    colours, values = ("Combined", *LIGHT, "StandardError"), ("Alpha", "Transmittance", "Depth")
    assert shown["sockets"] == {**dict.fromkeys(colours, "RGBA"), **dict.fromkeys(values, "VALUE")}


def test_blender_shows_what_openexr_reads(picture, shown):
    _, channels = picture
    for name in ("Combined", *LIGHT, "StandardError"):
        expected = layer(channels, "" if name == "Combined" else name)
        assert np.array_equal(shown["arrays"][name][:3], expected), name
    assert np.array_equal(shown["arrays"]["Combined"][3], channels["A"])
    for name, channel in (("Alpha", "A"), ("Transmittance", "Transmittance.X"), ("Depth", "Depth.Z")):
        assert np.array_equal(shown["arrays"][name][0], channels[channel]), name
