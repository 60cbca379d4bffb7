"""What the scripts that run inside Blender share. Imported there only: `from kit import *`."""
import math
import os
import time

import bpy
import numpy as np
from mathutils import Matrix, Vector


def start():
    """An empty Blender."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


def link(name, data=None, **properties):
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    for key, value in properties.items():
        setattr(thing, key, value)
    return thing


def named(name):
    """The object that an operator has just added, under a name of ours."""
    thing = bpy.context.object
    thing.name = name
    return thing


def ico(name, radius=1.0, at=(0, 0, 0), subdivisions=2, **operator):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=subdivisions, radius=radius, location=at, **operator)
    return named(name)


def uv(name, radius=1.0, at=(0, 0, 0), segments=16, rings=8, **operator):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=rings, radius=radius, location=at, **operator)
    return named(name)


def sun(strength=3.0, toward=(1, -1, 2)):
    light = bpy.data.lights.new("Sun", "SUN")
    light.energy = strength
    return link("Sun", light, rotation_euler=Vector(toward).to_track_quat("Z", "Y").to_euler())


def camera(at=(0, -10, 2), target=(0, 0, 0), ortho=None, angle=0.7):
    lens = bpy.data.cameras.new("Camera")
    thing = link("Camera", lens, location=at)
    thing.rotation_euler = (Vector(target) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    if ortho:
        lens.type, lens.ortho_scale = "ORTHO", ortho
    else:
        lens.angle = angle
    distance = (Vector(target) - Vector(at)).length
    lens.clip_start, lens.clip_end = distance * 1e-3, distance * 1e3
    bpy.context.scene.camera = thing
    return thing


def export(path, **options):
    """Writes glTF with all that a layout needs."""
    extension = os.path.splitext(path)[1]
    settings = dict(export_format="GLB" if extension == ".glb" else "GLTF_SEPARATE", export_extras=True,
                    export_lights=True, export_cameras=True, export_animations=False)
    settings.update(options)
    bpy.ops.export_scene.gltf(filepath=path, **settings)
    return path


def import_volume(path):
    """The volume object that File > Import > OpenVDB makes, as it makes it."""
    before = set(bpy.context.scene.objects)
    bpy.ops.object.volume_import(filepath=path, align="WORLD", location=(0, 0, 0))
    (thing,) = (o for o in bpy.context.scene.objects if o not in before)
    thing.data.grids.load()
    return thing


def principled(volume, density, colour, absorption=(0, 0, 0), anisotropy=0.0, emission=None, grid=None):
    """A Principled Volume as an artist would add it: Density times the grid named `density`; Emission Color times `grid`, or even."""
    material = bpy.data.materials.new("Cloud")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeVolumePrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], out.inputs["Volume"])
    shader.inputs["Density"].default_value = density
    shader.inputs["Color"].default_value = (*(colour,) * 3, 1.0)
    shader.inputs["Absorption Color"].default_value = (*absorption, 1.0)
    shader.inputs["Anisotropy"].default_value = anisotropy
    if emission is not None:
        strongest = max(emission)
        shader.inputs["Emission Color"].default_value = (*(e / strongest for e in emission), 1.0)
        shader.inputs["Emission Strength"].default_value = strongest
        if grid:
            attribute, times = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeMath")
            attribute.attribute_name, times.operation, times.inputs[1].default_value = grid, "MULTIPLY", strongest
            tree.links.new(attribute.outputs["Fac"], times.inputs[0])
            tree.links.new(times.outputs[0], shader.inputs["Emission Strength"])
    volume.data.materials.append(material)
    return shader


def sky(radiance, image=None):
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    world.use_nodes = True
    background = world.node_tree.nodes.get("Background") or world.node_tree.nodes.new("ShaderNodeBackground")
    background.inputs[0].default_value, background.inputs[1].default_value = (1, 1, 1, 1), radiance
    if image:
        texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
        texture.image = bpy.data.images.load(image)
        background.inputs["Strength"].default_value = 1.0
        world.node_tree.links.new(texture.outputs["Color"], background.inputs["Color"])


def settings(width, height, samples, bounces=0, step_rate=0.5, seed=1):
    """Cycles without anything that would make its pictures other than the plain mean of independent paths."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces, cycles.volume_bounces = max(bounces, 4), bounces
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.pixel_filter_type = "BOX"
    if hasattr(cycles, "volume_step_rate"):
        cycles.volume_step_rate, cycles.volume_max_steps = step_rate, 4096
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = os.path.join(bpy.app.tempdir, "frame.exr")
    return scene


def shoot():
    """The picture with the settings as they are, linear: height x width x 3, row 0 at the top."""
    scene = bpy.context.scene
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    width, height = image.size
    pixels = np.array(image.pixels[:], np.float64).reshape(height, width, 4)[::-1, :, :3]
    bpy.data.images.remove(image)
    return pixels


def render(width, height, samples, bounces=0, step_rate=0.5):
    """Cycles' picture, linear: an array of height x width, row 0 at the top, the mean of the channels."""
    settings(width, height, samples, bounces, step_rate)
    return shoot().mean(axis=2)


def matte(albedo):
    """A Lambertian material."""
    material = bpy.data.materials.new("Matte")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.inputs[0].default_value, shader.inputs["Roughness"].default_value = (*(albedo,) * 3, 1.0), 0.0
    tree.links.new(shader.outputs[0], out.inputs["Surface"])
    return material


def stage(described):
    """Builds a scene of peers.py. Light and camera come first: in 5.2 a volume made before them was seen empty."""
    start()
    for lamp in described.get("lamps") or ():
        # A point light's power goes evenly into all directions.
        light = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
        light.data.energy, light.data.shadow_soft_size = 4 * math.pi * lamp["intensity"], 0.1
        light.location = lamp["position"]
        bpy.context.collection.objects.link(light)
    if described["sun"]["irradiance"] > 0:
        direction = Vector(described["sun"]["direction"])
        light = sun(described["sun"]["irradiance"], toward=-direction)
        light.data.angle = described["sun"]["angle"]
    eye = described["camera"]
    camera(eye["position"], eye["look_at"], angle=eye["fov_x"]).data.sensor_fit = "HORIZONTAL"
    sky(described["sky"], described.get("sky_image"))
    if described.get("ground"):
        ground = described["ground"]
        bpy.ops.mesh.primitive_plane_add(size=2 * ground["half_size"], location=(0, 0, ground["z"]))
        named("Ground").data.materials.append(matte(ground["albedo"]))
    for i, ball in enumerate(described.get("balls", ())):
        # A mesh lies inside its sphere: scaled to the sphere's volume, 80 thousand triangles are within 3e-5 of it (of many balls, 5
        # thousand within 5e-4).
        thing = ico(f"Ball.{i}", at=ball["centre"], subdivisions=7 if len(described["balls"]) < 40 else 5)
        volume = _volume(thing.data)
        thing.scale = (ball["radius"] * (4 / 3 * math.pi / volume) ** (1 / 3),) * 3
        principled(thing, ball["sigma"], ball["albedo"], anisotropy=ball["g"], emission=ball.get("emission"))
    if described.get("haze"):
        haze = described["haze"]
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0, 0, (haze["base"] + haze["top"]) / 2))
        thing = bpy.context.object
        thing.scale = (2 * haze["half_size"], 2 * haze["half_size"], haze["top"] - haze["base"])
        principled(thing, haze["sigma"], haze["albedo"], anisotropy=haze["g"])
    if described.get("vdb"):
        place(described["vdb"], described["voxel"], described["sigma"], described["albedo"], described["g"],
              described.get("place"), described.get("flame"))


def place(vdb, voxel, density, albedo, g, turned=None, flame=None):
    """A grid where OpenVDB says that it is, with its samples as they are. `turned` is the matrix in its transform, where one is."""
    volume = import_volume(vdb)
    volume.data.render.precision = "FULL"
    # Blender 4.5 takes OpenVDB's samples for the lower corners of voxels.
    back = Vector((-voxel * shift(),) * 3)
    volume.location = Matrix(turned).to_3x3() @ back if turned else back
    principled(volume, density, albedo, anisotropy=g, emission=flame, grid="flame")
    return volume


def shift():
    """How many voxels too far along each axis this Blender shows a VDB (test_cycles.py measures it)."""
    return 0.5 if bpy.app.version < (5, 0, 0) else 0.0


def _volume(mesh):
    mesh.calc_loop_triangles()
    points = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", points)
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    a, b, c = points.reshape(-1, 3)[corners.reshape(-1, 3)].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def shots(width, height, samples, seeds, bounces, step_rate, denoised=False):
    """Pictures of the scene as it is staged, one for each seed, and the seconds of each; `denoised` by OpenImageDenoise as Blender sets it up."""
    scene = settings(width, height, samples, bounces, step_rate)
    cycles = scene.cycles
    # Shadow rays pass the hulls of volumes as transparent hits; nothing is dropped for being faint.
    cycles.transparent_max_bounces, cycles.light_sampling_threshold = 1024, 0.0
    cycles.sampling_pattern = "TABULATED_SOBOL"
    if denoised:
        cycles.use_denoising, cycles.denoiser = True, "OPENIMAGEDENOISE"
    scene.render.use_persistent_data = True
    pictures, seconds = [], []
    for seed in seeds:
        cycles.seed = seed
        begin = time.perf_counter()
        pictures.append(shoot())
        seconds.append(time.perf_counter() - begin)
    return np.array(pictures), seconds


def transmittance(path, views, width, pixels, density, samples=16, step_rate=0.5, matrix=None):
    """Pictures of a VDB that only absorbs, before a white sky, by an orthographic camera: one for each view.

    `views` are ((centre), "x" | "y" | "z"): what the camera looks at and the axis it looks against. Columns run along
    the first of the other two axes, rows down the second (for "y", whose picture is mirrored, against the first).
    `matrix` is where the volume's object is; densities are per metre of the world then, not of the object.
    """
    scene = start()
    rays = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
    sky(1.0)
    lens = camera(ortho=width)
    volume = import_volume(path)
    volume.data.render.precision = "FULL"
    principled(volume, density, 0.0)
    if matrix is not None:
        volume.matrix_world, volume.data.render.space = Matrix(matrix), "WORLD"
    found = {"location": list(volume.location), "rotation": list(volume.rotation_euler), "scale": list(volume.scale),
             "type": volume.type, "grids": [g.name for g in volume.data.grids]}
    images = []
    for centre, axis in views:
        away = Vector(rays[axis])
        lens.location = Vector(centre) + away * 2 * width
        lens.rotation_euler = away.to_track_quat("Z", "Y").to_euler() if axis != "z" else (0, 0, 0)
        lens.data.clip_start, lens.data.clip_end = 0.01 * width, 10 * width
        bpy.context.view_layer.update()
        right, up = (lens.matrix_world.to_3x3() @ Vector(v) for v in ((1, 0, 0), (0, 1, 0)))
        images.append((list(right), list(up), render(pixels, pixels, samples, step_rate=step_rate)))
    return found, images


def import_balls(path):
    """Imports glTF, and returns what its spheres are, from their vertices: name, centre, radius, custom properties."""
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=path)
    bpy.context.view_layer.update()
    out = []
    for thing in bpy.data.objects:
        if thing in before or thing.type != "MESH":
            continue
        points = np.empty(3 * len(thing.data.vertices))
        thing.data.vertices.foreach_get("co", points)
        points = points.reshape(-1, 3) @ np.array(thing.matrix_world.to_3x3()).T + np.array(thing.matrix_world.translation)
        # The sphere through the vertices, by least squares about their mean; what is no sphere is left out.
        middle = points.mean(axis=0)
        points -= middle
        if np.linalg.svd(points, compute_uv=False)[2] < 1e-3 * np.abs(points).max():
            continue  # flat: the corners of a ground lie on spheres too
        fit = np.linalg.lstsq(np.c_[2 * points, np.ones(len(points))], (points ** 2).sum(axis=1), rcond=None)[0]
        radius = math.sqrt(fit[3] + fit[:3] @ fit[:3])
        if np.abs(np.linalg.norm(points - fit[:3], axis=1) - radius).max() > 1e-3 * radius:
            continue
        medium = dict(thing["cloudvdb"]) if "cloudvdb" in thing else {}
        for material in thing.data.materials:
            if material and "cloudvdb" in material:
                medium = {**dict(material["cloudvdb"]), **medium}
        out.append({"name": thing.name, "centre": (middle + fit[:3]).tolist(), "radius": radius, "cloudvdb": plain(medium)})
    return out


def plain(value):
    """Blender's property groups and arrays as dicts and lists."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if hasattr(value, "to_list"):
        return value.to_list()
    return value
