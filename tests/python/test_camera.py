"""What Blender's camera sees of a scene that Blender exported, cloudvdb sees too: turned, rolled, wide, upright, clipped.

Nothing is said on the command line but the picture's size: camera, sun, media and ground come from the file.
"""
import json

import numpy as np
import pytest

import peers
from blender import blender
from peers import ball, described
from ztest import Picture, compare

SCRIPT = """
scene, eye = given["scene"], given["eye"]
stage(scene)
lens = bpy.context.scene.camera
lens.data.sensor_fit, lens.data.angle = eye["fit"], eye["angle"]
lens.rotation_euler.rotate_axis("Z", eye["roll"])
if "clip" in eye:
    lens.data.clip_start, lens.data.clip_end = eye["clip"]
frame = settings(scene["width"], scene["height"], given["samples"], 64)
for i, ball in enumerate(scene["balls"]):
    bpy.data.objects[f"Ball.{i}"]["cloudvdb"] = json.dumps(
        {"sigma_t": ball["sigma"], "albedo": ball["albedo"], "g": ball["g"], "shape": "sphere"})
bpy.context.scene["cloudvdb"] = json.dumps({"sun_angle": scene["sun"]["angle"], "sky": scene["sky"]})
for thing in bpy.data.objects:
    if thing.type == "MESH" and thing.name.startswith("Ball"):
        # A coarse sphere through the same points is enough for a file: its vertices say where the sphere is.
        radius = scene["balls"][int(thing.name.split(".")[1])]["radius"]
        fine, materials = thing.data, thing.scale.copy()
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=1.0)
        coarse = bpy.context.object
        thing.data, thing.scale = coarse.data, (radius,) * 3
        thing["fine"] = fine.name
        thing["as"] = list(materials)
        bpy.data.objects.remove(coarse)
# glTF knows a ground by its base colour, which Blender writes of a Principled BSDF alone.
ground = bpy.data.objects["Ground"].data
matte, principled_ground = ground.materials[0], bpy.data.materials.new("Ground")
principled_ground.use_nodes = True
principled_ground.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*(scene["ground"]["albedo"],) * 3, 1.0)
ground.materials[0] = principled_ground
export(given["path"])
ground.materials[0] = matte
for thing in bpy.data.objects:
    if "fine" in thing:
        thing.data, thing.scale = bpy.data.meshes[thing["fine"]], thing["as"]
frame.cycles.transparent_max_bounces, frame.cycles.light_sampling_threshold = 1024, 0.0
pictures = []
for seed in range(8):
    frame.cycles.seed = seed
    pictures.append(shoot())
arrays["images"] = np.array(pictures)
"""

BALLS = [ball((-0.5, 0.1, 0.3), 0.8, 6.0, 0.95, 0.6), ball((0.6, -0.3, 0.1), 0.5, 9.0, 0.99, 0.3)]
EYES = {
    "wide and rolled": (40, 20, {"fit": "AUTO", "angle": 0.9, "roll": 0.5}),
    "upright": (20, 32, {"fit": "AUTO", "angle": 0.9, "roll": 0.0}),
    "by its height": (32, 20, {"fit": "VERTICAL", "angle": 0.6, "roll": -0.2}),
    "clipped behind and before the clouds": (32, 24, {"fit": "HORIZONTAL", "angle": 0.75, "roll": 0.0, "clip": (4.2, 6.4)}),
}


@pytest.mark.parametrize("name", EYES)
def test_the_camera_of_a_file(cloudvdb, tmp_path, name):
    width, height, eye = EYES[name]
    scene = described(width, height, sky=0.3, balls=BALLS, ground={"z": -0.9, "albedo": 0.6},
                      camera={"position": (1.5, -4.9, 1.2), "look_at": (0.1, 0.0, 0.0)})
    path, target = tmp_path / "scene.glb", tmp_path / "ours.exr"
    seen = blender("import json\n" + SCRIPT, scene=peers.plain(scene), eye=eye, path=str(path), samples=24)
    ran = cloudvdb.succeed(path, "-o", target, "--density", "source", "--integrator", "path", "--spp", 512, "--size", f"{width}x{height}", "--json")
    report = json.loads(ran.out)
    assert not [n for n in report["notes"] if "camera" in n.lower()], report["notes"]
    layers = peers.read_exr(target)
    verdict = compare(Picture.from_error(layers["Combined"], layers["StandardError"]), Picture.from_seeds(seen["arrays"]["images"]), name)
    print(verdict)
    assert verdict.agree and verdict.error < 0.02, verdict
    # The test has power: a pixel's shift would show.
    moved = np.roll(layers["Combined"], 1, axis=1)
    assert not compare(Picture.from_error(moved, layers["StandardError"]), Picture.from_seeds(seen["arrays"]["images"]), name,
                       folder=tmp_path).agree
