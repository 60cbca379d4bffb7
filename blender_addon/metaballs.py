# SPDX-License-Identifier: GPL-3.0-or-later
"""Metaballs to the glTF node extension `CLOUDVDB_metaballs`, and back."""
import math

import bpy
from mathutils import Matrix, Quaternion

EXTENSION = "CLOUDVDB_metaballs"
#: From Blender's axes (Z up) to glTF's (Y up).
Y_UP = Quaternion((1, 0, 0), -math.pi / 2)


def family(name):
    """The name that all objects of a metaball family share: without the number that Blender appends."""
    base, dot, digits = name.rpartition(".")
    return base if dot and digits.isdigit() else name


def members(thing, scene):
    """All objects of the metaball's family in the scene; Blender counts hidden ones too."""
    base = family(thing.name)
    return [other for other in scene.objects if other.type == "META" and family(other.name) == base]


def to_extension(thing, y_up=True):
    """What the extension of the object's node says; `None` where no element is shown."""
    elements = [_element(one, y_up) for one in thing.data.elements if not one.hide and one.radius > 0]
    if not elements:
        return None
    return {"threshold": thing.data.threshold, "family": family(thing.name), "elements": elements}


def _element(one, y_up):
    co, q = one.co, one.rotation.normalized()
    if y_up:
        co, q = (co[0], co[2], -co[1]), Quaternion((q.w, q.x, q.z, -q.y))
    else:
        # The file's axes are Blender's; the kinds' axes are still glTF's.
        q = q @ Y_UP.inverted()
    return {"type": one.type, "co": list(co), "radius": one.radius, "stiffness": one.stiffness, "negative": one.use_negative,
            "size": [one.size_x, one.size_z, one.size_y], "rotation": [q.x, q.y, q.z, q.w]}


def from_extension(value, name):
    """Metaball data made of what a node's extension says."""
    data = bpy.data.metaballs.new(name)
    data.threshold = value.get("threshold", 0.6)
    largest = 0.0
    for said in value.get("elements", []):
        one = data.elements.new(type=said.get("type", "BALL"))
        x, y, z = said.get("co", (0, 0, 0))
        one.co = (x, -z, y)
        one.radius, one.stiffness = said["radius"], said.get("stiffness", 2.0)
        one.use_negative = said.get("negative", False)
        one.size_x, one.size_z, one.size_y = said.get("size", (1, 1, 1))
        x, y, z, w = said.get("rotation", (0, 0, 0, 1))
        one.rotation = (w, x, -z, y)
        largest = max(largest, one.radius)
    show(data, largest)
    return data


def show(data, size):
    """Surfaces fine enough for elements of this size, and no finer."""
    data.resolution = data.render_resolution = max(0.12 * size, 1e-3)


def visible(threshold, stiffness):
    """The radius at which a lone element is seen, over its radius."""
    return math.sqrt(max(1.0 - (threshold / stiffness) ** (1 / 3), 0.0))


def z_up(matrix):
    """A glTF world matrix in Blender's axes."""
    turn = Y_UP.to_matrix().to_4x4()
    return turn.inverted() @ matrix @ turn


def from_gltf_matrix(node):
    """The local matrix of a glTF node, in glTF's axes."""
    if "matrix" in node:
        m = node["matrix"]
        return Matrix([[m[4 * column + row] for column in range(4)] for row in range(4)])
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    scale = Matrix.Diagonal((*node.get("scale", (1, 1, 1)), 1))
    return Matrix.Translation(node.get("translation", (0, 0, 0))) @ Quaternion((w, x, y, z)).to_matrix().to_4x4() @ scale
