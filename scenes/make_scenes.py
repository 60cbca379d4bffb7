"""Writes the scenes of this folder with Blender's own exporter: `make scenes`.

Each function below makes one scene from nothing; everything is seeded, so the files come out the same again.
"""
import base64
import json
import math
import os
import random

import bpy
from mathutils import Vector

HERE = os.path.dirname(os.path.abspath(__file__))
# Metres, fitted to the thesis's counts (hura2006.md): the radius of every ball of the tests, the width of the cumulus.
HURA_RADIUS, HURA_CUMULUS = 6.5, 30.5


def start():
    bpy.ops.wm.read_factory_settings(use_empty=True)


def link(name, data):
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def ball_mesh(name):
    """A unit icosphere, smooth (one vertex a corner in the file) and without texture coordinates."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=1.0, calc_uvs=False)
    thing = bpy.context.object
    mesh = thing.data
    mesh.name = name
    mesh.shade_smooth()
    bpy.data.objects.remove(thing)
    return mesh


def sphere(name, mesh, centre, radius):
    thing = link(name, mesh)
    thing.location = centre
    thing.scale = (radius,) * 3
    return thing


def sun(elevation, azimuth, strength, angle=None):
    """A sun `elevation` degrees high, `azimuth` degrees from +X toward +Y; strength in W/m^2 across its rays."""
    light = bpy.data.lights.new("Sun", "SUN")
    light.energy = strength
    e, a = math.radians(elevation), math.radians(azimuth)
    toward = Vector((math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)))
    thing = link("Sun", light)
    thing.rotation_euler = toward.to_track_quat("Z", "Y").to_euler()  # a light shines along its -Z
    thing.location = toward
    return thing


def camera(position, target, fov, size=(640, 480)):
    """A camera with a horizontal angle of view of `fov` degrees, which becomes the scene's, for pictures of `size` pixels."""
    lens = bpy.data.cameras.new("Camera")
    lens.sensor_fit, lens.angle = "HORIZONTAL", math.radians(fov)
    distance = (Vector(target) - Vector(position)).length
    lens.clip_start, lens.clip_end = 0.01 * distance, 100.0 * distance
    thing = link("Camera", lens)
    thing.location = position
    thing.rotation_euler = (Vector(target) - Vector(position)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = thing
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = size


def ground(size, z, grey):
    bpy.ops.mesh.primitive_plane_add(size=size, location=(0, 0, z), calc_uvs=False)
    thing = bpy.context.object
    thing.name = "Ground"
    material = bpy.data.materials.new("Ground")
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (grey, grey, grey, 1.0)
    shader.inputs["Roughness"].default_value = 1.0
    thing.data.materials.append(material)


def cloud_material(name, medium):
    """A material whose custom property is a medium: every object that uses it is filled with it."""
    material = bpy.data.materials.new(name)
    material["cloudvdb"] = medium
    return material


def write(name):
    """Exports the scene as one text file, with its buffer inside as a data URI."""
    path = os.path.join(HERE, name + ".gltf")
    bpy.ops.export_scene.gltf(
        filepath=path, export_format="GLTF_SEPARATE", export_extras=True, export_lights=True, export_cameras=True,
        export_texcoords=False, export_animations=False)
    with open(path) as file:
        gltf = json.load(file)
    for buffer in gltf.get("buffers", []):
        binary = os.path.join(HERE, buffer["uri"])
        with open(binary, "rb") as file:
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(file.read()).decode()
        os.remove(binary)
    with open(path, "w") as file:
        json.dump(gltf, file, indent="\t")
        file.write("\n")
    print(f"{path}: {os.path.getsize(path)} bytes")


def cumulus_layout(width, base):
    """21 balls: six on a flat base at the height `base`, nine around the middle, six billows on top; `width` across; metres."""
    rng = random.Random(2006)
    balls = []

    def ring(count, distance, height, radius, turn):
        for i in range(count):
            angle = math.tau * (i + turn + rng.uniform(-0.2, 0.2)) / count
            away = distance * rng.uniform(0.85, 1.1)
            r = radius * rng.uniform(0.85, 1.15)
            # Balls of the base stand on it: their lowest points are level.
            z = r if height is None else height * rng.uniform(0.92, 1.08)
            balls.append(((away * math.cos(angle), 0.8 * away * math.sin(angle), z), r))

    ring(6, 275.0, None, 125.0, 0.0)
    ring(8, 190.0, 215.0, 120.0, 0.4)
    balls.append(((10.0, -15.0, 240.0), 165.0))
    ring(5, 95.0, 370.0, 95.0, 0.7)
    balls.append(((25.0, 10.0, 470.0), 90.0))
    assert len(balls) == 21
    low, high = (f(x + s * r for (x, _, _), r in balls) for f, s in ((min, -1), (max, 1)))
    scale, middle = width / (high - low), (high + low) / 2
    return [(((x - middle) * scale, y * scale, base + z * scale), r * scale) for (x, y, z), r in balls]


def cumulus():
    start()
    balls = cumulus_layout(900.0, 350.0)
    # Optical depth 20 across the largest ball.
    sigma_t = 20.0 / (2.0 * max(r for _, r in balls))
    albedo = 0.9999
    print(f"cumulus: sigma_t {sigma_t:.5f} per metre")
    mesh = ball_mesh("Ball")
    mesh.materials.append(cloud_material("Cumulus", {
        "sigma_s": sigma_t * albedo, "sigma_a": sigma_t * (1.0 - albedo), "g": 0.86}))
    for i, (centre, radius) in enumerate(balls):
        sphere(f"Cloud.{i + 1:03}", mesh, centre, radius)
    ground(8000.0, 0.0, 0.3)
    sun(35.0, -15.0, 3.0)
    camera((-150.0, -2100.0, 450.0), (0.0, 0.0, 560.0), 38.0)
    write("cumulus")


def two_spheres():
    start()
    mesh = ball_mesh("Ball")
    sphere("Cloud.001", mesh, (-0.6, 0.0, 1.2), 1.2)
    sphere("Cloud.002", mesh, (0.9, 0.2, 1.0), 1.0)
    sun(40.0, -60.0, 3.0)
    camera((0.0, -8.0, 2.0), (0.1, 0.0, 1.1), 40.0)
    write("two_spheres")


def hura2006(count):
    """Table 2 of the thesis: one, two or three balls in a row above a plane, none in another's light."""
    start()
    mesh = ball_mesh("Ball")
    mesh.materials.append(cloud_material("Cloud", "hura2006"))
    for i in range(count):
        sphere(f"Cloud.{i + 1:03}", mesh, (16.0 * (i - 0.5 * (count - 1)), 0.0, 12.0), HURA_RADIUS)
    ground(80.0, 0.0, 0.5)
    # From behind, where a medium that scatters forward is bright; shadows fall before the balls.
    sun(50.0, 80.0, 3.0)
    away = 24.0 + 16.0 * count
    camera((0.0, -away, 12.0 + 0.25 * away), (0.0, -4.0, 7.0), 50.0, (100, 100))
    write(f"hura2006_{count}")


def hura2006_cumulus():
    """The 21 regions of the thesis's 4.2, in its medium: the balls of `cumulus`, so small that the duality makes 256 of them."""
    start()
    mesh = ball_mesh("Ball")
    mesh.materials.append(cloud_material("Cloud", "hura2006"))
    for i, (centre, radius) in enumerate(cumulus_layout(HURA_CUMULUS, 0.4 * HURA_CUMULUS)):
        sphere(f"Cloud.{i + 1:03}", mesh, centre, radius)
    ground(9.0 * HURA_CUMULUS, 0.0, 0.3)
    sun(45.0, 60.0, 3.0)
    camera((-0.17 * HURA_CUMULUS, -2.3 * HURA_CUMULUS, 0.5 * HURA_CUMULUS), (0.0, 0.0, 0.62 * HURA_CUMULUS), 38.0)
    write("hura2006_cumulus")


def sunbeams():
    """A broken deck between the viewer and the sun, in hazy air: its gaps send beams that run toward the sun by perspective."""
    start()
    rng = random.Random(22)
    mesh = ball_mesh("Ball")
    mesh.materials.append(cloud_material("Cloud", {"sigma_t": 0.05, "albedo": 0.9999, "g": 0.86}))
    count = 0
    for row in range(9):
        for column in range(13):
            x, y = 320.0 * (column - 6 + rng.uniform(-0.4, 0.4)), 900.0 + 330.0 * (row + rng.uniform(-0.4, 0.4))
            radius, gap = rng.uniform(130.0, 260.0), rng.random() < 0.22
            if gap:
                continue
            count += 1
            thing = sphere(f"Cloud.{count:03}", mesh, (x, y, 1250.0 + rng.uniform(-40.0, 40.0)), radius)
            thing.scale = (radius, radius * rng.uniform(0.8, 1.2), 0.4 * radius)
    ground(40000.0, 0.0, 0.15)
    sun(33.0, 90.0, 3.0)
    camera((0.0, -1500.0, 60.0), (0.0, 900.0, 560.0), 62.0)
    bpy.context.scene["cloudvdb"] = {"atmosphere": {"preset": "clear", "visibility": 9000.0}}
    write("sunbeams")


def slab():
    """A stratus deck: an empty object with extras; 8 optical depths, which the tables of the tests have."""
    start()
    deck = link("Deck", None)
    deck.location = (0.0, 0.0, 500.0)
    deck["cloudvdb"] = {"shape": "slab", "half_height": 100.0, "sigma_s": 0.04, "sigma_a": 0.0, "g": 0.85}
    sun(90.0, 0.0, 3.0)
    camera((0.0, -2000.0, 1200.0), (0.0, 0.0, 500.0), 50.0)
    write("slab")


if __name__ == "__main__":
    cumulus()
    two_spheres()
    slab()
    for balls in (1, 2, 3):
        hura2006(balls)
    hura2006_cumulus()
    sunbeams()
