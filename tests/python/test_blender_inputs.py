"""Files that Blender itself writes are read as an artist means them."""
import base64
import json
import math

import pytest

import gltf
import vdbinfo
from blender import blender
from command import make, refuse

SIGMA = 2.0
BALL = 4.0 / 3.0 * math.pi

# What Blender makes: each function's scene goes to a file of its name. All spheres get a medium of SIGMA per metre.
SCRIPT = r"""
medium = {"sigma_s": 1.5, "sigma_a": 0.5, "g": 0.8}

def fill(*things):
    for thing in things:
        thing["cloudvdb"] = dict(medium)

def kinds():
    fill(ico("Ico", at=(-2, 0, 1)), uv("Uv", at=(2, 0.5, 1)))

def flat_shaded():
    fill(ico("Ico", radius=0.7, at=(1, 2, 3), subdivisions=3))
    smooth = uv("Uv", radius=0.5, at=(-1, 2, 3)); smooth.data.shade_smooth(); fill(smooth)

def turned():
    thing = ico("Ball", at=(1, 2, 3)); thing.scale = (2, 2, 2); thing.rotation_euler = (0.3, 0.4, 0.5); fill(thing)

def ellipsoid():
    thing = uv("Ball", at=(1, 2, 3)); thing.scale = (1.0, 2.0, 0.5); thing.rotation_euler = (0.3, 0.4, 0.5); fill(thing)

def mirrored():
    thing = ico("Mirrored", at=(-3, 0, 0)); thing.scale = (-1.0, 1.0, 1.5); fill(thing)

def parented():
    parent = link("Parent", location=(5, 0, 0), scale=(2, 2, 2), rotation_euler=(0, 0, math.pi / 2))
    child = ico("Child", radius=0.5, at=(0, 0, 0)); child.parent = parent; child.location = (1, 0, 0); fill(child)

def sheared():
    parent = link("Parent", scale=(1, 1, 2))
    child = ico("Child", at=(0, 0, 0)); child.parent = parent; child.scale = (1, 0.5, 1); child.rotation_euler = (math.pi / 4, 0, 0); fill(child)

def linked():
    first = ico("First", radius=0.6, at=(0, 0, 0)); fill(first)
    for i in range(2):
        fill(link(f"Linked.{i}", first.data, location=(2 + 2 * i, 0, 0), scale=(1 + i,) * 3))

def instances():
    source = bpy.data.collections.new("Puffs")
    for i in range(2):
        thing = ico(f"Puff.{i}", radius=0.5, at=(i, 0, 0)); fill(thing)
        bpy.context.scene.collection.objects.unlink(thing); source.objects.link(thing)
    for i in range(2):
        empty = link(f"Instance.{i}", location=(0, 3 * i, 1), scale=(1 + i,) * 3)
        empty.instance_type, empty.instance_collection = "COLLECTION", source

def applied():
    thing = uv("Applied", at=(1, 2, 3)); thing.scale = (1.5, 1.5, 1.5)
    bpy.ops.object.select_all(action="DESELECT"); thing.select_set(True); bpy.context.view_layer.objects.active = thing
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True); fill(thing)

def material():
    first, second = ico("First", at=(0, 0, 0)), ico("Second", at=(3, 0, 0), radius=0.5)
    m = bpy.data.materials.new("Cloud"); m["cloudvdb"] = dict(medium)
    first.data.materials.append(m); second.data.materials.append(m)

def staged():
    fill(ico("Cloud", at=(0, 0, 2)))
    sun(); camera()
    bpy.ops.mesh.primitive_plane_add(size=20); named("Ground")
    bpy.ops.object.empty_add(); named("Null")

def suzanne():
    fill(ico("Cloud", at=(0, 0, 3)))
    bpy.ops.mesh.primitive_monkey_add(); named("Suzanne")

def metaball():
    fill(ico("Cloud", at=(0, 0, 3)))
    bpy.ops.object.metaball_add(type="BALL", radius=2.0); named("Mball")

def metaball_alone():
    bpy.ops.object.metaball_add(type="BALL", radius=2.0); named("Mball")

def cube():
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(1, 2, 3)); thing = named("Cube"); thing.rotation_euler = (0.3, 0.2, 0.1); fill(thing)

def cube_by_extras():
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(1, 2, 3)); named("Cube")["cloudvdb"] = dict(medium, shape="mesh")

def nothing():
    pass

def sun_only():
    sun(); camera()

def awkward_names():
    fill(ico("Wolke \u00fc \u96f2 / 1", at=(0, 0, 0)))

def no_medium():
    ico("Cloud", at=(0, 0, 0))

def scene_medium():
    bpy.context.scene["cloudvdb"] = {"medium": dict(medium)}; ico("Cloud", at=(0, 0, 0))

def preset():
    ico("Cloud", radius=100.0, at=(0, 0, 0))["cloudvdb"] = {"preset": "stratus"}

def ignored():
    fill(ico("Cloud", at=(0, 0, 0)))
    ico("Planet", at=(5, 0, 0))["cloudvdb"] = {"shape": "surface"}
    ico("Guide", at=(-5, 0, 0))["cloudvdb"] = {"shape": "ignore"}

def extras_sphere():
    link("Puff", location=(1, 2, 3), scale=(2, 2, 2))["cloudvdb"] = dict(medium, shape="sphere", radius=0.5)

def paint(mesh):
    m = bpy.data.materials.new("Cloud"); m["cloudvdb"] = dict(medium); mesh.materials.append(m)

def gpu():
    # Instances lose their own custom properties in Blender's exporter; their material keeps its.
    first = ico("First", radius=0.5, at=(0, 0, 0)); paint(first.data)
    parent = link("Rows")
    first.parent = parent
    for i in range(3):
        other = link(f"Other.{i}", first.data, location=(2 * (i + 1), 0, 1), scale=(1 + i,) * 3); other.parent = parent

def geometry_nodes():
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=0.5, location=(0, 0, -10)); puff = named("Puff"); paint(puff.data)
    mesh = bpy.data.meshes.new("Points"); mesh.from_pydata([(0, 0, 0), (3, 0, 0), (0, 3, 1)], [], [])
    thing = link("Scatter", mesh)
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    inp, outp = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    on, what = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeObjectInfo")
    what.inputs["Object"].default_value = puff; what.inputs["As Instance"].default_value = True
    tree.links.new(inp.outputs[0], on.inputs["Points"]); tree.links.new(what.outputs["Geometry"], on.inputs["Instance"])
    tree.links.new(on.outputs[0], outp.inputs[0])
    thing.modifiers.new("Scatter", "NODES").node_group = tree

OPTIONS = {
    "gpu": {"export_gpu_instances": True},
    "geometry_nodes": {"export_gpu_instances": True, "export_gn_mesh": True},
}
makers = [kinds, flat_shaded, turned, ellipsoid, mirrored, parented, sheared, linked, instances, applied, material, staged, suzanne, metaball,
          metaball_alone, cube, cube_by_extras, nothing, sun_only, awkward_names, no_medium, scene_medium, preset, ignored, extras_sphere, gpu, geometry_nodes]
for make in makers:
    start(); make()
    export(f"{given['folder']}/{make.__name__}.glb", **OPTIONS.get(make.__name__, {}))
    if make is staged:
        export(f"{given['folder']}/staged_separate.gltf")
        export(f"{given['folder']}/draco.glb", export_draco_mesh_compression_enable=True)
        export(f"{given['folder']}/y_up_off.glb", export_yup=False)
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder with all of Blender's files: one process writes them."""
    folder = tmp_path_factory.mktemp("blender")
    blender(SCRIPT, folder=str(folder))
    document = json.loads((folder / "staged_separate.gltf").read_text())
    for buffer in document["buffers"]:
        data = (folder / buffer["uri"]).read_bytes()
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    (folder / "staged_embedded.gltf").write_text(json.dumps(document))
    return folder


def check(cloudvdb, scene, folder, volumes, centre, *arguments, sigma=SIGMA):
    """Regions, optical mass and place: `volumes` in m^3, `centre` is that of mass in Blender's frame."""
    report = make(scene, folder, "--density", "source", *arguments)
    assert report.regions_source == len(volumes), report.data["found"]
    mass = sigma * sum(volumes)
    assert report.mass_source == pytest.approx(mass, rel=2e-3)
    density = vdbinfo.read(folder / "out.vdb")["grids"]["density"]
    assert density["integral"] * report.density_scale == pytest.approx(mass, rel=5e-3)
    assert density["centroid"] == pytest.approx(centre, abs=0.05 * density["voxel_size"])
    return report


def weighted(*parts):
    """The common centre of (volume, centre) pairs."""
    total = sum(v for v, _ in parts)
    return [sum(v * c[k] for v, c in parts) / total for k in range(3)]


SHAPES = {
    "kinds": [(BALL, (-2, 0, 1)), (BALL, (2, 0.5, 1))],
    "flat_shaded": [(BALL * 0.7 ** 3, (1, 2, 3)), (BALL * 0.5 ** 3, (-1, 2, 3))],
    "turned": [(BALL * 8, (1, 2, 3))],
    "ellipsoid": [(BALL, (1, 2, 3))],
    "parented": [(BALL, (5, 2, 0))],
    "sheared": [(BALL, (0, 0, 0))],
    "linked": [(BALL * 0.6 ** 3, (0, 0, 0)), (BALL * 0.6 ** 3, (2, 0, 0)), (BALL * 1.2 ** 3, (4, 0, 0))],
    "instances": [(BALL / 8, (0, 0, 1)), (BALL / 8, (1, 0, 1)), (BALL, (0, 3, 1)), (BALL, (2, 3, 1))],
    "applied": [(BALL * 1.5 ** 3, (1, 2, 3))],
    "material": [(BALL, (0, 0, 0)), (BALL / 8, (3, 0, 0))],
    "scene_medium": [(BALL, (0, 0, 0))],
    "extras_sphere": [(BALL, (1, 2, 3))],
    "gpu": [(BALL / 8, (0, 0, 0)), (BALL / 8, (2, 0, 1)), (BALL, (4, 0, 1)), (BALL * 27 / 8, (6, 0, 1))],
    "awkward_names": [(BALL, (0, 0, 0))],
    "staged": [(BALL, (0, 0, 2))],
}


@pytest.mark.parametrize("name", SHAPES)
def test_spheres_of_every_kind(cloudvdb, written, tmp_path, name):
    check(cloudvdb, written / f"{name}.glb", tmp_path, [v for v, _ in SHAPES[name]], weighted(*SHAPES[name]))


@pytest.mark.parametrize("name", ["staged.glb", "staged_separate.gltf", "staged_embedded.gltf"])
def test_sun_camera_ground_and_medium_in_all_formats(cloudvdb, written, tmp_path, name):
    report = check(cloudvdb, written / name, tmp_path, [BALL], (0, 0, 2))
    assert report.became("region") == ["Cloud"]
    assert report.became("surface") == ["Ground"]
    assert report.became("sun") == ["Sun"]
    assert report.became("camera") == ["Camera"]


def test_geometry_nodes_instances(cloudvdb, written, tmp_path):
    """Blender writes EXT_mesh_gpu_instancing for them: one node that is three balls, besides the original."""
    document = gltf.read(written / "geometry_nodes.glb")
    if "EXT_mesh_gpu_instancing" not in document.get("extensionsUsed", []):
        pytest.skip("this exporter wrote no instances")
    points = [(0, 0, 0), (3, 0, 0), (0, 3, 1), (0, 0, -10)]
    check(cloudvdb, written / "geometry_nodes.glb", tmp_path, [BALL / 8] * 4, weighted(*((1, p) for p in points)))


def test_y_up_off_is_a_matter_of_the_file(cloudvdb, written, tmp_path):
    """With the exporter's "+Y up" off, the file's up is Blender's y; nothing in the file says so."""
    check(cloudvdb, written / "y_up_off.glb", tmp_path, [BALL], (0, -2, 0))


def test_suzanne_is_a_surface(cloudvdb, written, tmp_path):
    report = check(cloudvdb, written / "suzanne.glb", tmp_path, [BALL], (0, 0, 3))
    assert report.became("surface") == ["Suzanne"]


def test_surface_and_ignore_by_extras(cloudvdb, written, tmp_path):
    report = check(cloudvdb, written / "ignored.glb", tmp_path, [BALL], (0, 0, 0))
    assert report.became("surface") == ["Planet"]
    assert report.became("ignored") == ["Guide"]
    assert report.why("Guide")


def test_a_metaball_is_missed_aloud(cloudvdb, written, tmp_path):
    """Blender's exporter leaves an empty node where a metaball was."""
    report = check(cloudvdb, written / "metaball.glb", tmp_path, [BALL], (0, 0, 3))
    assert "Mball" in report.became("ignored")
    told = " ".join(report.notes) + report.why("Mball") + report.ran.err
    assert "Mball" in told and "metaball" in told.lower()


def test_a_metaball_alone_is_refused_with_the_way_out(cloudvdb, written, tmp_path):
    refuse(written / "metaball_alone.glb", "-o", tmp_path / "out.vdb", says=["metaball_alone.glb", "Mball", ("add-on", "mesh")],
           folder=tmp_path)


def test_draco_is_refused(cloudvdb, written, tmp_path):
    document = gltf.read(written / "draco.glb")
    if "KHR_draco_mesh_compression" not in document.get("extensionsRequired", []):
        pytest.skip("this Blender has no Draco library")
    refuse(written / "draco.glb", "-o", tmp_path / "out.vdb", says=["draco.glb", "draco", "compress"], folder=tmp_path)


def test_a_mirrored_region_is_refused(cloudvdb, written, tmp_path):
    refuse(written / "mirrored.glb", "-o", tmp_path / "out.vdb", says=["mirrored.glb", "Mirrored", "Apply the scale"], folder=tmp_path)


@pytest.mark.parametrize("name", ["nothing", "sun_only"])
def test_nothing_to_fill_says_what_a_region_can_be(cloudvdb, written, tmp_path, name):
    refuse(written / f"{name}.glb", "-o", tmp_path / "out.vdb", says=[f"{name}.glb", "region", "sphere", "custom property"], folder=tmp_path)


@pytest.mark.parametrize("name, options", [("cube", ["--mesh-volumes"]), ("cube_by_extras", [])])
def test_a_closed_mesh_on_request(cloudvdb, written, tmp_path, name, options):
    report = make(written / f"{name}.glb", tmp_path, "--density", "source", *options)
    assert report.became("region") == ["Cube"]
    assert report.mass_source == pytest.approx(SIGMA * 8.0, rel=2e-3)
    density = vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    assert density["integral"] * report.density_scale == pytest.approx(SIGMA * 8.0, rel=2e-2)
    assert density["centroid"] == pytest.approx((1, 2, 3), abs=0.1 * density["voxel_size"])


def test_without_a_medium_the_cloud_is_thick(cloudvdb, written, tmp_path):
    """Optical depth 40 across the largest region, and the report says so."""
    report = check(cloudvdb, written / "no_medium.glb", tmp_path, [BALL], (0, 0, 0), sigma=20.0)
    assert any("40" in note for note in report.notes), report.notes


def test_preset(cloudvdb, written, tmp_path):
    check(cloudvdb, written / "preset.glb", tmp_path, [BALL * 1e6], (0, 0, 0), sigma=0.03)


def test_regions_by_name(cloudvdb, written, tmp_path):
    report = make(written / "linked.glb", tmp_path, "--density", "source", "--regions", "Linked*")
    assert report.became("region") == ["Linked.0", "Linked.1"]


@pytest.mark.parametrize("name", ["cumulus", "two_spheres"])
def test_scenes_of_the_repository(cloudvdb, scenes, tmp_path, name):
    document = gltf.read(scenes / f"{name}.gltf")
    volumes = [BALL * abs(m[0, 0] * m[1, 1] * m[2, 2]) for i, m in gltf.world_matrices(document).items()
               if document["nodes"][i]["name"].startswith("Cloud")]
    report = make(scenes / f"{name}.gltf", tmp_path, "--density", "source")
    assert report.regions_source == len(volumes)
    sigma = 40.0 / 2.4
    if name == "cumulus":
        medium = document["materials"][0]["extras"]["cloudvdb"]
        sigma = medium["sigma_s"] + medium["sigma_a"]
    assert report.mass_source == pytest.approx(sigma * sum(volumes), rel=2e-3)
    assert report.became("sun") == ["Sun"] and report.became("camera") == ["Camera"]
