# SPDX-License-Identifier: GPL-3.0-or-later
"""The material of a cloud, and the bounces it needs."""
import bpy

#: Bounces below which a thick cloud is visibly dark.
BOUNCES = 64


def principled(material):
    """The material's Principled Volume; `None` where it has none."""
    tree = material.node_tree if material else None
    return next((node for node in tree.nodes if node.type == "PRINCIPLED_VOLUME"), None) if tree else None


def create(name, density, albedo, anisotropy):
    """A Principled Volume whose medium is that of the grid: a sample of 1 has extinction `density` per metre."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, out = tree.nodes.new("ShaderNodeVolumePrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.location, out.location = (0, 0), (320, 0)
    tree.links.new(shader.outputs[0], out.inputs["Volume"])
    shader.inputs["Density Attribute"].default_value = "density"
    shader.inputs["Density"].default_value = density
    shader.inputs["Color"].default_value = (albedo, albedo, albedo, 1.0)
    shader.inputs["Anisotropy"].default_value = anisotropy
    return material


def follow(material, record, density, albedo, anisotropy):
    """Sets what the cloud's new medium changes, but nothing that the user has changed since `record`. Says what was left."""
    shader = principled(material)
    if shader is None:
        return [f'The material "{material.name}" has no Principled Volume, and was left as it is; the cloud\'s Density is {density:.6g}']
    left = []
    for name, old, new in (("Density", record.density, density), ("Anisotropy", record.anisotropy, anisotropy)):
        socket = shader.inputs[name]
        if not socket.is_linked and _same(socket.default_value, old):
            socket.default_value = new
        elif not _same(old, new):
            left.append(f'{name} of the material "{material.name}" is yours, and was left; the cloud\'s is {new:.6g}')
    colour = shader.inputs["Color"]
    if not colour.is_linked and all(_same(channel, record.albedo) for channel in colour.default_value[:3]):
        colour.default_value[:3] = (albedo,) * 3
    return left


def _same(a, b):
    return abs(a - b) <= 1e-6 * max(abs(a), abs(b))


def raise_bounces(scene):
    """Raises Cycles' bounces to what clouds need; says what was changed."""
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return []
    told = []
    for name, words in (("volume_bounces", "Volume"), ("max_bounces", "Total")):
        old = getattr(cycles, name)
        if old < BOUNCES:
            setattr(cycles, name, BOUNCES)
            told.append(f"{words} {old} -> {BOUNCES}")
    return [f"Light Paths > Max Bounces: {', '.join(told)}"] if told else []
