"""The README's picture, rendered with Cycles: `.venv/bin/python -I scenes/gallery/render.py` (after `make build`).

Left the layout (`--density source`), right the regions that the duality makes of it; everything else is the same in
both halves: `scenes/cumulus.gltf`'s camera and sun, the sky, the ground, the material, the samples. The material is the
one that README.md describes. Takes about three minutes a half on two cores; `--samples 8 --scale 25` gives a draft in seconds.

`CLOUDVDB=/another/cloudvdb` names another binary, as for the tests. Nothing is written but the picture.
"""
import argparse
import json
import math
import os
import subprocess
import tempfile

import bpy
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
SCENE = os.path.join(ROOT, "scenes", "cumulus.gltf")
SIZE = (640, 480)
GAP = 8  # white columns between the halves


def voxelise(density, folder):
    """Runs cloudvdb; returns the grid's path and its report."""
    command = os.environ.get("CLOUDVDB", os.path.join(ROOT, "target", "release", "cloudvdb"))
    path = os.path.join(folder, density + ".vdb")
    # Both at one voxel size, so that Cycles takes the same steps in both.
    done = subprocess.run([command, SCENE, "-o", path, "--density", density, "--voxel-size", "7", "--json", "-q"],
                          check=True, stdout=subprocess.PIPE)
    return path, json.loads(done.stdout)


def layout():
    """The scene as Blender imports it, without the balls: sun, camera and ground stay."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=SCENE)
    for thing in list(bpy.data.objects):
        if thing.name.startswith("Cloud."):
            bpy.data.objects.remove(thing)
        elif thing.type == "LIGHT":
            thing.data.angle = 0.00918  # glTF has no word for it
        elif thing.type == "CAMERA":
            bpy.context.scene.camera = thing
            thing.data.clip_end = 1e5
            # Lower and closer than the scene's own: the cloud stands before the sky.
            thing.location = (-150.0, -2150.0, 150.0)
            thing.rotation_mode = "XYZ"
            thing.rotation_euler = (math.radians(101.2), 0.0, math.radians(-3.5))
            thing.data.angle = math.radians(28.5)
    ground = bpy.data.objects["Ground"]
    ground.scale = (12.0, 12.0, 1.0)  # to the horizon
    ground.data.materials[0].node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.022, 0.034, 0.017, 1.0)


def sky():
    """Blue overhead, pale at the horizon."""
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    add = tree.nodes.new
    where, split, ramp = add("ShaderNodeTexCoord"), add("ShaderNodeSeparateXYZ"), add("ShaderNodeValToRGB")
    background, out = add("ShaderNodeBackground"), add("ShaderNodeOutputWorld")
    tree.links.new(where.outputs["Generated"], split.inputs[0])
    tree.links.new(split.outputs["Z"], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], background.inputs["Color"])
    tree.links.new(background.outputs[0], out.inputs["Surface"])
    low, high = ramp.color_ramp.elements
    low.position, low.color = 0.0, (0.36, 0.60, 0.90, 1.0)
    high.position, high.color = 0.55, (0.025, 0.14, 0.45, 1.0)
    background.inputs["Strength"].default_value = 0.19


def cloud(path, report):
    """Imports the grid and gives it the material that README.md describes."""
    bpy.ops.object.volume_import(filepath=path, align="WORLD", location=(0, 0, 0))
    volume = bpy.context.object
    # Blender 4.5 shows grids half a voxel too far along each axis.
    half = 0.5 * report["vdb"]["voxel_size"] if bpy.app.version < (5, 0) else 0.0
    volume.location = (-half, -half, -half)
    material = bpy.data.materials.new("Cumulus")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeVolumePrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], out.inputs["Volume"])
    shader.inputs["Density"].default_value = report["vdb"]["density_scale"]
    shader.inputs["Color"].default_value = (0.9999, 0.9999, 0.9999, 1.0)
    shader.inputs["Anisotropy"].default_value = 0.86
    volume.data.materials.append(material)
    return volume


def render(samples, path, scale, brighter=0.0):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, 1
    # Total counts too: it cuts the volume's bounces where it is lower.
    cycles.max_bounces = cycles.volume_bounces = 64
    cycles.use_adaptive_sampling = False
    cycles.use_denoising, cycles.denoiser = True, "OPENIMAGEDENOISE"
    cycles.sample_clamp_indirect = 0.0
    cycles.volume_step_rate = 4.0  # 28 m, a third of a mean free path
    scene.view_settings.view_transform, scene.view_settings.look = "AgX", "AgX - High Contrast"
    scene.view_settings.exposure = 2.15 + brighter
    scene.render.dither_intensity = 0.0
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, scale
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGB"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


def pixels(path):
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    return np.array(image.pixels[:], np.float32).reshape(height, width, 4)


def compose(paths, target):
    """The halves side by side."""
    left, right = (pixels(path) for path in paths)
    picture = np.concatenate([left, np.ones((left.shape[0], GAP, 4), np.float32), right], axis=1)
    image = bpy.data.images.new("Cumulus", picture.shape[1], picture.shape[0], alpha=False)
    image.colorspace_settings.name = "Non-Color"
    image.pixels[:] = picture.ravel()
    settings = bpy.context.scene.render.image_settings
    settings.compression = 100
    image.filepath_raw, image.file_format = target, "PNG"
    image.save(quality=100)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--scale", type=int, default=100, help="percent of 2 x 640x480")
    parser.add_argument("-o", "--output", default=os.path.join(HERE, "cumulus.png"))
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        halves = []
        for density in ("source", "duality"):
            layout()
            sky()
            cloud(*voxelise(density, folder))
            halves.append(os.path.join(folder, density + ".png"))
            render(arguments.samples, halves[-1], arguments.scale)
        compose(halves, arguments.output)


if __name__ == "__main__":
    main()
