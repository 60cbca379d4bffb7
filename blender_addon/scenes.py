# SPDX-License-Identifier: GPL-3.0-or-later
"""New layouts: a cumulus of metaballs, a field of them, a scene with sunbeams, a sun and a sky."""
import math

import bpy
from mathutils import Vector

from . import media, metaballs


def family_name(base):
    """A name whose family of metaballs is new: else the new cloud would melt into an old one."""
    taken = {metaballs.family(thing.name) for thing in bpy.data.objects}
    name, number = base, 1
    while name in taken:
        number += 1
        name = f"{base} {number}"
    return name


def cumulus(context, name, at, width, height, puffs, chance):
    """A metaball like a cumulus: flat below, towers above, all by the random numbers of `chance`."""
    data = bpy.data.metaballs.new(name)
    thing = bpy.data.objects.new(name, data)
    thing.location = at
    half, seen = 0.5 * width, metaballs.visible(data.threshold, 2.0)

    def puff(x, y, z, size, flat=1.0):
        """An element whose surface alone would have the radius `size`, its middle at the height z."""
        one = data.elements.new(type="ELLIPSOID")
        one.co, one.radius, one.size_z = (x, y, z), size / seen, flat
        one.size_x = one.size_y = 1.0

    for number in range(puffs):
        # Around the middle by the golden angle; the farther out, the smaller and the lower.
        out = min(math.sqrt((number + 0.5) / puffs) * chance.uniform(0.85, 1.1), 1.0)
        angle = 2.399963 * number + chance.uniform(-0.4, 0.4)
        x, y = (0.8 * half * out * f for f in (math.cos(angle), math.sin(angle)))
        size = half * (0.34 - 0.14 * out) * chance.uniform(0.8, 1.2)
        puff(x, y, 0.45 * size, size, 0.45)
        top = height * (1.0 - 0.9 * out ** 2) * chance.uniform(0.45, 1.0) - 0.7 * size
        z = 0.8 * size
        while z < top:
            puff(x + 0.3 * size * chance.uniform(-1, 1), y + 0.3 * size * chance.uniform(-1, 1), z, 0.85 * size)
            z, size = z + 0.75 * size, 0.92 * size
    metaballs.show(data, 0.25 * width)
    context.collection.objects.link(thing)
    return thing


def deck(context, name, at, half, gaps, chance):
    """A closed layer of metaballs with round gaps, so thick and dark that light comes through the gaps alone."""
    data = bpy.data.metaballs.new(name)
    thing = bpy.data.objects.new(name, data)
    thing.location = at
    thing[media.KEY] = {"sigma_t": 15.0, "albedo": 0.95, "g": 0.86}
    layer = data.elements.new(type="PLANE")
    layer.radius, layer.size_x, layer.size_y = 3.0, *half
    for _ in range(3 * gaps):
        puff = data.elements.new(type="BALL")
        puff.co = (half[0] * chance.uniform(-1, 1), half[1] * chance.uniform(-1, 1), chance.uniform(-0.5, 1))
        puff.radius = chance.uniform(4, 8)
    for number in range(gaps):
        gap = data.elements.new(type="BALL")
        gap.co = (half[0] * 0.8 * (2 * (number + chance.random()) / gaps - 1), half[1] * chance.uniform(-0.6, 0.6), 0)
        gap.radius, gap.stiffness, gap.use_negative = chance.uniform(4, 6), 10.0, True
    metaballs.show(data, 6)
    context.collection.objects.link(thing)
    return thing


def select(context, things):
    """Selects these and nothing else: the button Synthesise Cloud is next."""
    for other in context.selected_objects:
        other.select_set(False)
    for thing in things:
        thing.select_set(True)
        context.view_layer.objects.active = thing


def sun_and_sky(context, toward=(0.5, -0.6, 0.75), strength=8.0, sky=0.4):
    """A Sun from `toward`, and a plain blue sky; a world that is not Blender's grey stays."""
    scene = context.scene
    light = bpy.data.lights.new("Sun", "SUN")
    light.energy, light.angle = strength, 0.00918
    thing = bpy.data.objects.new("Sun", light)
    thing.rotation_euler = Vector(toward).to_track_quat("Z", "Y").to_euler()
    thing.location = Vector(toward) * 10
    context.collection.objects.link(thing)
    shines = media.sky(scene.world)
    if scene.world is None or (isinstance(shines, list) and max(shines) - min(shines) < 1e-6):
        world = scene.world = scene.world or bpy.data.worlds.new("World")
        world.use_nodes = True
        nodes = world.node_tree.nodes
        background = next((node for node in nodes if node.type == "BACKGROUND"), None)
        if background is None:
            background = nodes.new("ShaderNodeBackground")
            output = nodes.new("ShaderNodeOutputWorld")
            world.node_tree.links.new(background.outputs[0], output.inputs["Surface"])
        background.inputs["Color"].default_value = (0.24, 0.47, 1.0, 1.0)
        background.inputs["Strength"].default_value = sky
    return thing


def haze(context, name, size, at, density):
    """A box of thin air in which shadows show: a volume of Blender's own, which the command leaves out."""
    bpy.ops.mesh.primitive_cube_add(size=1, location=at)
    thing = context.object
    thing.name, thing.scale, thing.display_type = name, size, "WIRE"
    thing[media.KEY] = "ignore"
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeVolumeScatter"), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Density"].default_value, shader.inputs["Anisotropy"].default_value = density, 0.7
    tree.links.new(shader.outputs[0], out.inputs["Volume"])
    thing.data.materials.append(material)
    return thing


def camera(context, at, target, angle):
    """A camera that looks at `target`; the scene's own from now on."""
    thing = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    thing.location, thing.data.angle = at, angle
    thing.rotation_euler = (Vector(target) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    thing.data.clip_end = 100 * (Vector(target) - Vector(at)).length
    context.collection.objects.link(thing)
    context.scene.camera = thing
    return thing
