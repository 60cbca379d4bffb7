"""Pictures of the scripts that `--bake` writes, in a Blender of their own, and how far they are off."""
import math

from blender import blender
from grid_error import blocks

#: Runs a script that the command has written, and takes its pictures.
SHOW = """
import runpy
start()
runpy.run_path(given["setup"], run_name="__main__")
scene = bpy.context.scene
scene.cycles.samples, scene.cycles.pixel_filter_type, scene.cycles.use_adaptive_sampling = given["samples"], "BOX", False
scene.cycles.volume_bounces = scene.cycles.max_bounces = given["bounces"]
if given["eevee"]:
    engines = [item.identifier for item in bpy.types.RenderSettings.bl_rna.properties["engine"].enum_items]
    scene.render.engine = next((name for name in ("BLENDER_EEVEE_NEXT", "BLENDER_EEVEE") if name in engines), "BLENDER_EEVEE")
    scene.render.filter_size = 0.01
    scene.eevee.taa_render_samples = given["samples"]
material = next(m for m in bpy.data.materials if "Live Volume" in m.node_tree.nodes)
if given["live"]:
    material.node_tree.nodes["Live"].outputs[0].default_value = 1.0
for name, factor in given["factors"].items():
    material.node_tree.nodes["Baked Light"].inputs[name].default_value = factor
live = material.node_tree.nodes["Live Volume"]
out["live"] = [live.inputs["Anisotropy"].default_value, live.inputs["Density"].links[0].from_node.outputs[0].default_value]
out["things"] = sorted(thing.type for thing in scene.objects)
out["size"] = [scene.render.resolution_x, scene.render.resolution_y]
scene.render.resolution_percentage = 100 * given["scale"]
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = os.path.abspath("shot.exr")
scene.render.use_persistent_data = given["persistent"]
images, out["seconds"] = [], []
for place in given["places"]:
    if place:
        scene.camera.location = place
        scene.camera.rotation_euler = (Vector((0, 0, 0.2)) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    for shot in range(given["shots"]):
        scene.cycles.seed = shot
        begin = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        out["seconds"].append(time.perf_counter() - begin)
    image = bpy.data.images.load(scene.render.filepath)
    w, h = image.size
    images.append(np.array(image.pixels[:], np.float32).reshape(h, w, 4)[::-1, :, :3])
    bpy.data.images.remove(image)
arrays["images"] = np.array(images)
"""


def shown(script, samples=4, bounces=0, live=False, factors=None, places=(None,), python=None, eevee=False, shots=1, scale=1,
          persistent=False, timeout=900):
    """The pictures from `places` (None: the bake's own camera), the last of `shots` each; `seconds` of all shots."""
    return blender(SHOW, python=python, setup=str(script), samples=samples, bounces=bounces, live=live, factors=factors or {}, places=places,
                   eevee=eevee, shots=shots, scale=scale, persistent=persistent, timeout=timeout)


def off(image, truths, size=1):
    """The relative RMSE of an image over lit pixels (or blocks), and that of its mean, against two independent pictures of the truth: the
    product of the differences to either has their noise in it with neither sign, so it is the square of the image's own error."""
    found, a, b = (blocks(x, size) for x in (image, *truths))
    level = (a + b) / 2
    lit = level > 0.02 * level.max()
    square = ((found - a) * (found - b))[lit].mean()
    return math.copysign(math.sqrt(abs(square)), square) / level[lit].mean(), found[lit].mean() / level[lit].mean() - 1
