"""`fire.png`: a fire of Blender's own fluid simulation, lit by the sun, by its flames, and by its heat.

    blender --background --python scenes/gallery/fire.py

bakes the simulation (a minute), exports the layout as glTF and renders it with target/release/cloudvdb. Needs Blender as a program (the
module cannot bake) and ImageMagick.
"""
import json
import math
import pathlib
import subprocess
import tempfile

import bpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
FRAMES = 42
FLOOR = -0.02


def simulate(folder):
    """Bakes fire and smoke over a ball; returns the VDB of the last frame."""
    bpy.ops.mesh.primitive_cube_add(size=2, location=(0, 0, 1.6))
    box = bpy.context.object
    box.scale = (1.0, 1.0, 1.6)
    bpy.ops.object.transform_apply(location=False, scale=True)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.28, location=(0, 0, 0.3))
    source = bpy.context.object
    modifier = box.modifiers.new("Fluid", "FLUID")
    modifier.fluid_type = "DOMAIN"
    domain = modifier.domain_settings
    domain.domain_type, domain.resolution_max, domain.cache_type = "GAS", 96, "ALL"
    domain.vorticity, domain.burning_rate, domain.flame_vorticity = 0.15, 0.5, 0.6
    domain.cache_directory, domain.cache_data_format = str(folder), "OPENVDB"
    domain.cache_frame_start, domain.cache_frame_end = 1, FRAMES
    flow = source.modifiers.new("Fluid", "FLUID")
    flow.fluid_type = "FLOW"
    flow.flow_settings.flow_type, flow.flow_settings.flow_behavior = "BOTH", "INFLOW"
    flow.flow_settings.fuel_amount, flow.flow_settings.temperature = 0.9, 1.0
    bpy.context.scene.frame_end = FRAMES
    bpy.context.view_layer.objects.active = box
    bpy.ops.fluid.bake_all()
    corner = [min(v.co[axis] for v in box.data.vertices) + box.location[axis] for axis in range(3)]
    for thing in (box, source):
        bpy.data.objects.remove(thing)
    return folder / "data" / f"fluid_data_{FRAMES:04}.vdb", corner


def layout(path, vdb, corner, sun, **fire):
    """A ground, a camera, perhaps a sun, and the volume with what shines of it, as Blender exports them."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, FLOOR))
    bpy.ops.object.empty_add(location=corner)
    bpy.context.object["cloudvdb"] = json.dumps(
        {"shape": "vdb", "file": vdb.name, "sigma_t": 7.0, "albedo": 0.55, "g": 0.4, **fire})
    if sun:
        bpy.ops.object.light_add(type="SUN", rotation=(0.9, 0, 0.7))
        bpy.context.object.data.energy = 3.0
    bpy.ops.object.camera_add(location=(0, -7.6, 1.9), rotation=(math.radians(88), 0, 0))
    bpy.context.scene.camera = bpy.context.object
    bpy.context.object.data.angle = 0.36
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 360, 480
    bpy.ops.export_scene.gltf(filepath=str(path), export_extras=True, export_lights=True, export_cameras=True)


def main():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        vdb, corner = simulate(folder)
        kinds = {"sun": (True, {}, "0"),
                 "flames": (False, {"emission_grid": "flame", "emission": [24.0, 7.0, 1.1]}, "0"),
                 "heat": (False, {"temperature_grid": "temperature", "temperature": 1000, "soot": 1.0}, "-5.5")}
        pictures = []
        for name, (sun, fire, exposure) in kinds.items():
            glb = vdb.with_name(f"{name}.glb")
            layout(glb, vdb, corner, sun, **fire)
            pictures.append(str(folder / f"{name}.png"))
            subprocess.run([str(ROOT / "target/release/cloudvdb"), str(glb), "-o", pictures[-1], "--density", "source", "--size", "360x480",
                            "--spp", "24", "--photons", "2M", "--exposure", exposure], check=True)
        subprocess.run(["convert", *pictures, "+append", "-colors", "255", str(ROOT / "scenes/gallery/fire.png")], check=True)


main()
