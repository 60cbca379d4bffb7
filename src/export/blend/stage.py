import json
import math
import os

from mathutils import Matrix, Vector


def volume(cloud, path, collection):
    """The Volume object with its material."""
    data = bpy.data.volumes.new(cloud["name"])
    data.filepath = path
    thing = bpy.data.objects.new(cloud["name"], data)
    if bpy.app.version < (5, 0, 0):
        # Blender before 5.0 takes a voxel's centre for its corner.
        thing.location = (-0.5 * cloud["voxel_size"],) * 3
    data.materials.append(material(cloud["name"], cloud))
    collection.objects.link(thing)
    return thing


def sun(cloud, collection):
    """The sun, of the same irradiance, colour and disc."""
    colour, direction = cloud["sun"]["irradiance"], cloud["sun"]["direction"]
    strongest = max(colour)
    if strongest <= 0.0:
        return
    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.energy, lamp.angle = strongest, cloud["sun"]["angle"]
    lamp.color = [channel / strongest for channel in colour]
    thing = bpy.data.objects.new("Sun", lamp)
    thing.rotation_euler = Vector(direction).to_track_quat("-Z", "Y").to_euler()
    thing.location = [high - 2 * (high - low) * way for (low, high), way in zip(zip(*cloud["bounds"]), direction)]
    collection.objects.link(thing)


def lamps(cloud, collection):
    """Points and spots, of the same intensity, colour, size and cone."""
    for lamp in cloud["lamps"]:
        spot, strongest = lamp["spot"], max(lamp["intensity"])
        light = bpy.data.lights.new(lamp["name"], "SPOT" if spot else "POINT")
        # Power is what intensity would add up to over all directions, of a spot too.
        light.energy, light.color = 4 * math.pi * strongest, [channel / strongest for channel in lamp["intensity"]]
        light.shadow_soft_size = lamp["radius"]
        if hasattr(light, "use_soft_falloff"):
            light.use_soft_falloff = False
        thing = bpy.data.objects.new(lamp["name"], light)
        thing.location, thing.visible_camera = lamp["position"], False
        if spot:
            thing.rotation_euler = Vector(spot["axis"]).to_track_quat("-Z", "Y").to_euler()
            cone(light, *spot["cosines"])
        collection.objects.link(thing)


def cone(light, inner, outer):
    """A spot's cone, by the cosines between which it fades: in Blender as x^2 (3 - 2 x), in glTF as x^2, which its nodes make of it for
    Cycles."""
    edge = max(inner - outer, 1e-3)
    light.spot_size, light.spot_blend = 2 * math.acos(outer), min(edge / max(1.0 - outer, 1e-9), 1.0)
    tree = Tree.of(light)
    turn = tree.node("ShaderNodeVectorTransform", vector_type="VECTOR", convert_from="WORLD", convert_to="OBJECT")
    tree.put(tree.node("ShaderNodeNewGeometry").outputs["Incoming"], turn.inputs[0])
    cosine = tree.vector("DOT_PRODUCT", tree.vector("NORMALIZE", turn.outputs[0]), (0.0, 0.0, -1.0))
    x = tree.node("ShaderNodeMath", operation="MULTIPLY_ADD", use_clamp=True)
    for value, socket in zip((cosine, 1.0 / edge, -outer / edge), x.inputs):
        tree.put(value, socket)
    emission = tree.node("ShaderNodeEmission")
    tree.put(tree.math("DIVIDE", 1.0, tree.math("MULTIPLY_ADD", x.outputs[0], -2.0, 3.0)), emission.inputs["Strength"])
    tree.put(emission.outputs[0], tree.node("ShaderNodeOutputLight").inputs["Surface"])


def sky(cloud, scene):
    """The sky: even, or an image of all directions."""
    world = bpy.data.worlds.new("Sky")
    tree = Tree.of(world)
    background = tree.node("ShaderNodeBackground")
    background.inputs["Color"].default_value = (*cloud["sky"], 1.0)
    if cloud["dome"]:
        width, height, texels = (cloud["dome"][key] for key in ("width", "height", "texels"))
        image = bpy.data.images.new("Sky", width, height, alpha=False, float_buffer=True)
        image.colorspace_settings.name = "Linear Rec.709"
        rows = [texels[i * width:(i + 1) * width] for i in reversed(range(height))]
        image.pixels.foreach_set([channel for row in rows for texel in row for channel in (*texel, 1.0)])
        image.pack()
        texture = tree.node("ShaderNodeTexEnvironment")
        texture.image = image
        tree.put(texture.outputs["Color"], background.inputs["Color"])
    tree.put(background.outputs[0], tree.node("ShaderNodeOutputWorld").inputs["Surface"])
    scene.world = world


def camera(cloud, scene, collection):
    """The camera of the bake, and the size of its picture."""
    view, lens = cloud["camera"], bpy.data.cameras.new("Camera")
    lens.sensor_fit, lens.angle_y = "VERTICAL", view["yfov"]
    thing = bpy.data.objects.new("Camera", lens)
    thing.matrix_world = Matrix([*view["matrix"], [0.0, 0.0, 0.0, 1.0]])
    near, far = depths(cloud, thing.matrix_world)
    lens.clip_start = view["near"] or max(1e-3 * far, 0.1 * near)
    lens.clip_end = view["far"] or max(100.0 * far, 1000.0)
    collection.objects.link(thing)
    scene.camera = thing
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = view["width"], view["height"], 100
    return near, far


def depths(cloud, world_from_camera):
    """How far before the camera the cloud begins and ends, m."""
    to_camera = world_from_camera.inverted()
    corners = [Vector((x, y, z)) for x, y, z in ((a[0], b[1], c[2]) for a in cloud["bounds"] for b in cloud["bounds"] for c in cloud["bounds"])]
    far = [-(to_camera @ corner).z for corner in corners]
    return max(min(far), 0.0), max(*far, 1e-6)


def surfaces(cloud, collection):
    """What is solid, with its diffuse colour."""
    for surface in cloud["surfaces"]:
        mesh = bpy.data.meshes.new(surface["name"])
        mesh.from_pydata(surface["vertices"], [], surface["triangles"])
        made = bpy.data.materials.new(surface["name"])
        tree = Tree.of(made)
        diffuse = tree.node("ShaderNodeBsdfDiffuse")
        diffuse.inputs["Color"].default_value = (*surface["albedo"], 1.0)
        tree.put(diffuse.outputs[0], tree.node("ShaderNodeOutputMaterial").inputs["Surface"])
        mesh.materials.append(made)
        collection.objects.link(bpy.data.objects.new(surface["name"], mesh))


def engines(cloud, scene, near, far):
    """What Cycles and EEVEE need for it."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    # A cloud whose light is baked has no noise but that of its edges.
    cycles.samples, cycles.use_denoising = (16 if cloud["bake"] else 128), not cloud["bake"]
    cycles.volume_bounces, cycles.max_bounces = max(cycles.volume_bounces, 64), max(cycles.max_bounces, 64)
    cycles.volume_max_steps = 1024
    if cloud["bake"] and hasattr(cycles, "volume_biased"):
        # Blender 5's unbiased volumes look for noise that is not there, and take a hundred times as long.
        cycles.volume_biased = True
    eevee, samples = scene.eevee, 128
    # EEVEE blurs volumes by about a tile, and 128 samples in depth do what 256 do: the smallest tile of at most 2^25 voxels.
    pixels = scene.render.resolution_x * scene.render.resolution_y
    tiles = sorted(int(item.identifier) for item in eevee.bl_rna.properties["volumetric_tile_size"].enum_items)
    tile = next((tile for tile in tiles if pixels * samples <= tile * tile * 2**25), tiles[-1])
    wanted = {"volumetric_tile_size": str(tile), "volumetric_samples": samples, "volumetric_sample_distribution": 0.0, "use_volume_custom_range": True,
              "volumetric_start": max(0.9 * near, 1e-3), "volumetric_end": 1.05 * far, "taa_render_samples": 16}
    for name, value in wanted.items():
        if hasattr(eevee, name):
            setattr(eevee, name, value)


def find(name):
    """The VDB: beside this script, wherever that is."""
    texts = [bpy.path.abspath(text.filepath) for text in bpy.data.texts if text.filepath and text.name.endswith(".blend.py")]
    for script in (globals().get("__file__", ""), *texts, bpy.data.filepath):
        path = os.path.join(os.path.dirname(os.path.abspath(script)), name) if script else ""
        if os.path.isfile(path):
            return path
    raise FileNotFoundError(f"{name} is not beside this script: put the two into one folder, or run cloudvdb again")


def main():
    """A new scene with the cloud, ready to be rendered."""
    cloud = json.loads(CLOUD)
    path = find(cloud["vdb"])
    scene = bpy.data.scenes.new(cloud["name"])
    collection = scene.collection
    sun(cloud, collection)
    lamps(cloud, collection)
    near, far = camera(cloud, scene, collection)
    volume(cloud, path, collection)
    surfaces(cloud, collection)
    sky(cloud, scene)
    engines(cloud, scene, near, far)
    scene.view_settings.view_transform = "Standard"
    if bpy.context.window:
        bpy.context.window.scene = scene
    return scene


if __name__ == "__main__":
    main()
