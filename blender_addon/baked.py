# SPDX-License-Identifier: MIT OR Apache-2.0
"""The material of a cloud whose light is in its grids. Used by the add-on, and part of every `.blend.py` that cloudvdb writes."""
import math

import bpy

from .lobes import FLOW, about_flow, harmonic, phase

#: EEVEE's materials read at most so many grids of light beside the density (a material has 15 attributes).
EEVEE_GRIDS = 14
#: What it may be shown, the best first: the largest degree of the harmonics, and how the lobe about the flow of light is held: as it is,
#: by a mean cosine of its own for all places, or even in all directions.
SHORTER = ((3, "whole"), (2, "alike"), (1, "alike"), (0, "even"))
#: The names of the lights, as the group of the baked light shows them.
LIGHTS = {"all": "Light", "sun": "Sun", "sky": "Sky", "red": "Light", "green": "Light", "blue": "Light"}

#: The grids of what shines by itself.
EMISSION = ("emission", "emission_red", "emission_green", "emission_blue")


class Tree:
    """A node tree, written as arithmetic: numbers, and sockets of nodes made before."""

    @classmethod
    def of(cls, block):
        """The emptied tree of a material or a world."""
        block.use_nodes = True
        block.node_tree.nodes.clear()
        return cls(block.node_tree)

    def __init__(self, tree):
        self.tree, self.column, self.grids = tree, 0, {}

    def node(self, kind, **settings):
        """A new node, beside the last one."""
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        node.location = (200 * (self.column // 6), -200 * (self.column % 6))
        self.column += 1
        return node

    def put(self, value, socket):
        """Links a socket, or sets it to a number or a vector."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def grid(self, name):
        """The samples of a grid."""
        if name not in self.grids:
            self.grids[name] = self.node("ShaderNodeAttribute", attribute_name=name, label=name).outputs[2]
        return self.grids[name]

    def math(self, operation, *values):
        """A number."""
        node = self.node("ShaderNodeMath", operation=operation)
        for value, socket in zip(values, node.inputs):
            self.put(value, socket)
        return node.outputs[0]

    def vector(self, operation, *values, scale=None):
        """A vector, or of a dot product and a length a number."""
        node = self.node("ShaderNodeVectorMath", operation=operation)
        for value, socket in zip(values, node.inputs):
            self.put(value, socket)
        if scale is not None:
            self.put(scale, node.inputs["Scale"])
        return node.outputs["Value" if operation in ("DOT_PRODUCT", "LENGTH") else "Vector"]

    def total(self, terms):
        """The sum of numbers."""
        whole = terms[0]
        for term in terms[1:]:
            whole = self.math("ADD", whole, term)
        return whole


def material(name, cloud):
    """A new material for a cloud: a dict with `density` (1/m for a sample of 1), `albedo` (RGB), `anisotropy`, `sun`, `bake` and `emission`.

    Where light is baked it absorbs and emits what the grids say, toward whoever the bake is for; its node "Live" set to 1 makes of it
    the Principled Volume that scatters by itself. Without a bake it is that alone. What shines by itself is added to either."""
    made = bpy.data.materials.new(name)
    tree = Tree.of(made)
    out = tree.node("ShaderNodeOutputMaterial")
    density = tree.node("ShaderNodeValue", name="Density", label="Density (1/m)")
    density.outputs[0].default_value = cloud["density"]
    live = tree.node("ShaderNodeVolumePrincipled", name="Live Volume")
    live.inputs["Density Attribute"].default_value = "density"
    live.inputs["Color"].default_value = (*cloud["albedo"], 1.0)
    live.inputs["Anisotropy"].default_value = cloud["anisotropy"]
    tree.put(density.outputs[0], live.inputs["Density"])
    if not cloud["bake"]:
        tree.put(_shining(tree, cloud, live.outputs[0]), out.inputs["Volume"])
        return made
    switch = tree.node("ShaderNodeValue", name="Live", label="Live: 0 baked light, 1 scattering")
    switch.outputs[0].default_value = 0.0
    light = tree.node("ShaderNodeGroup", name="Baked Light", label="Baked Light")
    light.node_tree = group(name, cloud)
    for socket in light.inputs:
        socket.default_value = 1.0
    extinction = tree.math("MULTIPLY", tree.grid("density"), density.outputs[0])
    absorption = tree.node("ShaderNodeVolumeAbsorption")
    absorption.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    tree.put(extinction, absorption.inputs["Density"])
    strength = extinction
    if cloud["bake"]["bake"] == "view":
        # What goes toward the camera is nobody else's light.
        strength = tree.math("MULTIPLY", extinction, tree.node("ShaderNodeLightPath").outputs["Is Camera Ray"])
    outs = [out]
    if len(light.outputs) > 1:
        outs.append(tree.node("ShaderNodeOutputMaterial"))
        out.target, outs[1].target = "CYCLES", "EEVEE"
    for source, out in zip(light.outputs, outs):
        emission = tree.node("ShaderNodeEmission")
        tree.put(source, emission.inputs["Color"])
        tree.put(strength, emission.inputs["Strength"])
        both, mix = tree.node("ShaderNodeAddShader"), tree.node("ShaderNodeMixShader")
        tree.put(absorption.outputs[0], both.inputs[0])
        tree.put(emission.outputs[0], both.inputs[1])
        tree.put(switch.outputs[0], mix.inputs[0])
        tree.put(both.outputs[0], mix.inputs[1])
        tree.put(live.outputs[0], mix.inputs[2])
        tree.put(_shining(tree, cloud, mix.outputs[0]), out.inputs["Volume"])
    return made


def _shining(tree, cloud, volume):
    """A volume that sends out, beside its own light, what grids say that shines by itself (W m^-3 sr^-1), to camera rays and all others."""
    for grid in cloud["emission"]:
        strength = tree.node("ShaderNodeValue", name=grid["name"], label=f"Strength of {grid['name']}")
        _set(tree, strength.outputs[0], grid, "scale")
        emission, both = tree.node("ShaderNodeEmission"), tree.node("ShaderNodeAddShader")
        emission.inputs["Color"].default_value = (*grid["tint"], 1.0)
        tree.put(tree.math("MULTIPLY", tree.grid(grid["name"]), strength.outputs[0]), emission.inputs["Strength"])
        tree.put(volume, both.inputs[0])
        tree.put(emission.outputs[0], both.inputs[1])
        volume = both.outputs[0]
    return volume


def group(name, cloud):
    """The node group of the baked light: radiance that the medium sends toward the viewer, per unit of optical depth (W m^-2 sr^-1,
    RGB). Its inputs are factors of the lights. Where there are more grids than EEVEE reads, a second output does with fewer."""
    bake, nodes = cloud["bake"], bpy.data.node_groups.new(f"{name} light", "ShaderNodeTree")
    tree = Tree(nodes)
    names = list(dict.fromkeys(LIGHTS[part["light"]] for part in bake["parts"]))
    for light in names:
        _socket(nodes, light, "INPUT", "NodeSocketFloat")
    ways = [SHORTER[0], *[way for way in SHORTER if _read(bake, way) <= EEVEE_GRIDS][:1]]
    for light, way in zip(("Light", "Light in EEVEE"), dict.fromkeys(ways)):
        _socket(nodes, light, "OUTPUT", "NodeSocketColor")
    factors, out = tree.node("NodeGroupInput"), tree.node("NodeGroupOutput")
    sunlight = _sunlight(tree, cloud["sun"])
    viewer = _viewer(tree) if any("light" not in part["grids"] for part in bake["parts"]) else None
    scales = [_number(tree, "Scale", part, "scale") for part in bake["parts"]]
    lobes = [_number(tree, "Lobe", part, "glow") if "glow" in part["grids"] else 0.0 for part in bake["parts"]]
    for way, socket in zip(dict.fromkeys(ways), out.inputs):
        whole = None
        for part, scale, lobe in zip(bake["parts"], scales, lobes):
            number = _toward(tree, (part, lobe), viewer, bake["g"], sunlight, way)
            number = tree.math("MULTIPLY", number, scale)
            number = tree.math("MULTIPLY", number, factors.outputs[names.index(LIGHTS[part["light"]])])
            colour = tree.vector("SCALE", tuple(part["tint"]), scale=number)
            whole = colour if whole is None else tree.vector("ADD", whole, colour)
        tree.put(whole if whole is not None else (0.0, 0.0, 0.0, 1.0), socket)
    return nodes


def _shown(key, way):
    """Whether a grid is read at all."""
    degree, flow = way
    if key in FLOW:
        return flow != "even"
    if key == "flow":
        return flow != "alike"
    return not key.isdigit() or int(key) < (degree + 1) ** 2


def _read(bake, way):
    """How many grids are."""
    return sum(_shown(key, way) for part in bake["parts"] for key in part["grids"])


def _toward(tree, light, viewer, g, sunlight, way):
    """What a light's grids send toward the viewer, in units of its scale."""
    part, lobe = light
    grids, terms = {key: name for key, name in part["grids"].items() if _shown(key, way)}, []
    flow = []
    for key, name in grids.items():
        samples = tree.grid(name)
        if key == "light":
            terms.append(samples)
        elif key in ("sunlight", "glow"):
            cosine = tree.vector("DOT_PRODUCT", viewer, sunlight)
            terms.append(tree.math("MULTIPLY", samples, phase(tree, cosine, g if key == "sunlight" else lobe)))
        elif key == "flow" or key in FLOW:
            flow.append(key)
        else:
            terms.append(tree.math("MULTIPLY", samples, harmonic(tree, viewer, int(key))))
    if flow:
        terms.append(about_flow(tree, grids, viewer))
    if not terms:
        return 0.0
    # Few harmonics may fall below zero where light is peaked.
    return tree.math("MAXIMUM", tree.total(terms), 0.0)


def _viewer(tree):
    """The direction toward the viewer, in the axes of the object."""
    turn = tree.node("ShaderNodeVectorTransform", vector_type="VECTOR", convert_from="WORLD", convert_to="OBJECT")
    tree.put(tree.node("ShaderNodeNewGeometry").outputs["Incoming"], turn.inputs[0])
    return tree.vector("NORMALIZE", turn.outputs[0])


def _number(tree, label, part, key):
    """A number of a part; where frames have their own, a node for it with a key for each."""
    if not part.get("frames"):
        return part[key]
    node = tree.node("ShaderNodeValue", name=f"{label} {part['light']}", label=label)
    _set(tree, node.outputs[0], part, key)
    return node.outputs[0]


def _set(tree, socket, part, key):
    """Sets a socket to a number of a part, with a key for each frame where these have their own."""
    socket.default_value = part[key]
    if part.get("frames"):
        _key(tree, socket, [(frame, numbers[key]) for frame, numbers in part["frames"]])


def _sunlight(tree, sun):
    """The way of the sun's light: a vector; a node with keys where frames have their own."""
    if not sun.get("frames"):
        return tuple(sun["direction"])
    node = tree.node("ShaderNodeCombineXYZ", name="Sunlight", label="Sunlight")
    for axis in range(3):
        _key(tree, node.inputs[axis], [(frame, way[axis]) for frame, way in sun["frames"]])
    return tree.vector("NORMALIZE", node.outputs[0])


def _key(tree, socket, frames):
    """A key for each frame, each held until the next."""
    for frame, value in frames:
        socket.default_value = value
        socket.keyframe_insert("default_value", frame=frame)
    socket.default_value = frames[0][1]
    for curve in curves(tree.tree):
        for point in curve.keyframe_points:
            point.interpolation = "CONSTANT"


def curves(tree):
    """The curves of what moves in a node tree; in Blender 5 they are in bags of an action's layers."""
    action = tree.animation_data.action if tree.animation_data else None
    if action is None:
        return []
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags for curve in bag.fcurves]


def _socket(nodes, name, side, kind):
    """A socket of a node group."""
    if hasattr(nodes, "interface"):
        nodes.interface.new_socket(name, in_out=side, socket_type=kind)
    else:
        (nodes.inputs if side == "INPUT" else nodes.outputs).new(kind, name)
