"""A layout as Blender imports it, with a grid in place of its clouds. Inside Blender only, as kit.py is."""
import bpy
from kit import matte, place, sky, start


def stage_layout(path, surfaces, vdb, voxel, density, albedo, g, moved=0.0):
    """Blender's own import of a layout, with a grid in place of what is no surface. Surfaces become Lambertian."""
    start()
    bpy.ops.import_scene.gltf(filepath=path)
    for thing in list(bpy.data.objects):
        if thing.type == "LIGHT":
            thing.data.angle = 0.00918  # glTF has no word for it
        elif thing.type == "CAMERA":
            bpy.context.scene.camera = thing
        elif thing.name in surfaces:
            (slot,) = thing.material_slots
            base = slot.material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value
            assert max(base[:3]) - min(base[:3]) < 1e-6, f"{thing.name} is not grey"
            slot.material = matte(base[0])
        else:
            bpy.data.objects.remove(thing)
    sky(0.0)
    volume = place(vdb, voxel, density, albedo, g)
    volume.location = [x + moved * voxel for x in volume.location]
