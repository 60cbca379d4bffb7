# SPDX-License-Identifier: GPL-3.0-or-later
"""The material of a cloud, and the bounces it needs."""
import hashlib

import bpy

from . import baked, baking
from .settings import BAKES

#: Settings of nodes that make a material look another way.
SAID = ("attribute_name", "operation", "vector_type", "convert_from", "convert_to", "blend_type")
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
        socket = _number(shader.inputs[name])
        if socket and _same(socket.default_value, old):
            socket.default_value = new
        elif not _same(old, new):
            left.append(f'{name} of the material "{material.name}" is yours, and was left; the cloud\'s is {new:.6g}')
    colour = shader.inputs["Color"]
    if not colour.is_linked and all(_same(channel, record.albedo) for channel in colour.default_value[:3]):
        colour.default_value[:3] = (albedo,) * 3
    return left


def _number(socket):
    """The socket that a number stands in: this one, or that of the node "Density", which baked materials have for two; `None` where
    other nodes make it."""
    if not socket.is_linked:
        return socket
    node = socket.links[0].from_node
    return node.outputs[0] if node.type == "VALUE" and node.name == "Density" else None


def dress(thing, cloud):
    """Gives a Volume the material for `cloud`, a dict of `baking.cloud`. One that it has follows the medium; where light is or was
    baked, one that nobody has touched is exchanged, and of another the light. Says what was left."""
    record, slots, kind = thing.cloudvdb_record, thing.data.materials, baking.kind(cloud)
    old = slots[0] if slots else None
    ours = old is None or (look(old.node_tree, old.name), look(_light(old))) == (record.look, record.glow)
    told = []
    plain = (kind, record.bake) == ("none", "none") and not cloud["emission"] and not _shining(old)
    if old is None or ours and not plain:
        name, parts = (old.name if old else thing.name), (cloud["density"], cloud["albedo"][0], cloud["anisotropy"])
        made = baked.material(name, cloud) if cloud["bake"] or cloud["emission"] else create(name, *parts)
        if old:
            slots[0] = made
            _forget(old)
            made.name = name
        else:
            slots.clear()
            slots.append(made)
        record.bake, old = kind, made
    else:
        told += follow(old, record, cloud["density"], cloud["albedo"][0], cloud["anisotropy"])
        told += _relight(old, record, cloud)
        shines, shone = {grid["name"]: grid["scale"] for grid in cloud["emission"]}, _shining(old)
        if shines.keys() != shone.keys() or not all(_same(shines[name], shone[name]) for name in shines):
            told.append(f'What shines by itself in the material "{old.name}" is yours, and was left: take it from the cloud, and press again')
    if ours:
        record.look, record.glow = look(old.node_tree, old.name), look(_light(old))
    return told


def _relight(material, record, cloud):
    """New light for a material that the user has changed; says where that cannot be."""
    kind, light = baking.kind(cloud), _light(material)
    shows = record.bake if light else "none"
    label = next(item[1] for item in BAKES if item[0] == kind)
    if shows != kind:
        return [f'The material "{material.name}" is yours, and was left, though Bake Light is now {label}: take it from the cloud, and press again']
    if kind == "none":
        return []
    if look(light) != record.glow:
        return [f'The baked light of the material "{material.name}" is yours, and was left: take the material from the cloud, and press again']
    node, name = material.node_tree.nodes["Baked Light"], light.name
    node.node_tree = baked.group(material.name, cloud)
    if not light.users:
        bpy.data.node_groups.remove(light)
        node.node_tree.name = name
    record.glow = look(node.node_tree)
    return []


def _shining(material):
    """The scales of the grids of what shines by itself, by name."""
    nodes = material.node_tree.nodes if material and material.node_tree else ()
    return {node.name: node.outputs[0].default_value for node in nodes if node.type == "VALUE" and node.name in baked.EMISSION}


def _light(material):
    """The group of a baked material's light; `None` where it has none."""
    node = material.node_tree.nodes.get("Baked Light") if material and material.node_tree else None
    return getattr(node, "node_tree", None)


def _forget(material):
    """Removes a material and its light, where nothing else shows them."""
    light = _light(material)
    if not material.users:
        bpy.data.materials.remove(material)
    if light and not light.users:
        bpy.data.node_groups.remove(light)


def look(tree, name=""):
    """A print of all that a node tree looks like; not of where its nodes are."""
    if tree is None:
        return ""
    curves = [(curve.data_path, [tuple(point.co) for point in curve.keyframe_points]) for curve in baked.curves(tree)]
    # Of what moves, the curve is its look, and not where it is now.
    moving = {path.split('"')[1] for path, _ in curves if path.startswith('nodes["')}
    nodes = [(node.name, node.bl_idname, node.mute, [getattr(node, key, None) for key in SAID],
              [] if node.name in moving else [_plain(s) for s in (*node.inputs, *node.outputs)]) for node in tree.nodes]
    links = [(link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier) for link in tree.links]
    return hashlib.sha256(repr((name, sorted(nodes, key=lambda node: node[0]), sorted(links), sorted(curves))).encode()).hexdigest()


def _plain(socket):
    """A socket's value, as something that can be printed."""
    value = getattr(socket, "default_value", None)
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


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
