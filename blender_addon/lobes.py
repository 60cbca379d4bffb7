# SPDX-License-Identifier: MIT OR Apache-2.0
"""Phase functions, lobes and harmonics as nodes of a material. Used by baked.py, and part of every `.blend.py` that cloudvdb writes."""
import math

import bpy

#: Real orthonormal spherical harmonics of degrees 0 to 3, in cloudvdb's order: a factor, and the powers of x, y, z that are summed.
HARMONICS = (
    (math.sqrt(1 / (4 * math.pi)), {(0, 0, 0): 1}),
    (math.sqrt(3 / (4 * math.pi)), {(0, 1, 0): 1}),
    (math.sqrt(3 / (4 * math.pi)), {(0, 0, 1): 1}),
    (math.sqrt(3 / (4 * math.pi)), {(1, 0, 0): 1}),
    (math.sqrt(15 / (4 * math.pi)), {(1, 1, 0): 1}),
    (math.sqrt(15 / (4 * math.pi)), {(0, 1, 1): 1}),
    (math.sqrt(5 / (16 * math.pi)), {(0, 0, 2): 3, (0, 0, 0): -1}),
    (math.sqrt(15 / (4 * math.pi)), {(1, 0, 1): 1}),
    (math.sqrt(15 / (16 * math.pi)), {(2, 0, 0): 1, (0, 2, 0): -1}),
    (math.sqrt(35 / (32 * math.pi)), {(2, 1, 0): 3, (0, 3, 0): -1}),
    (math.sqrt(105 / (4 * math.pi)), {(1, 1, 1): 1}),
    (math.sqrt(21 / (32 * math.pi)), {(0, 1, 2): 5, (0, 1, 0): -1}),
    (math.sqrt(7 / (16 * math.pi)), {(0, 0, 3): 5, (0, 0, 1): -3}),
    (math.sqrt(21 / (32 * math.pi)), {(1, 0, 2): 5, (1, 0, 0): -1}),
    (math.sqrt(105 / (16 * math.pi)), {(2, 0, 1): 1, (0, 2, 1): -1}),
    (math.sqrt(35 / (32 * math.pi)), {(3, 0, 0): 1, (1, 2, 0): -3}),
)
#: The grids of the flow of light along x, y and z.
FLOW = ("flowx", "flowy", "flowz")
#: The mean cosine of the lobe about the flow where it is the same for all places.
ALIKE = 0.6


def phase(tree, cosine, g):
    """The Henyey-Greenstein function, 1/sr."""
    if not isinstance(g, bpy.types.NodeSocket):
        base = tree.math("MULTIPLY_ADD", cosine, -2.0 * g, 1.0 + g * g)
        return tree.math("DIVIDE", (1.0 - g * g) / (4.0 * math.pi), tree.math("POWER", base, 1.5))
    square = tree.math("MULTIPLY", g, g)
    base = tree.math("MULTIPLY_ADD", cosine, tree.math("MULTIPLY", g, -2.0), tree.math("ADD", square, 1.0))
    whole = tree.math("MULTIPLY_ADD", square, -1.0 / (4.0 * math.pi), 1.0 / (4.0 * math.pi))
    return tree.math("DIVIDE", whole, tree.math("POWER", base, 1.5))


def about_flow(tree, grids, viewer):
    """The lobe about the flow of light."""
    if not any(key in grids for key in FLOW):
        return tree.math("MULTIPLY", tree.grid(grids["flow"]), 1.0 / (4.0 * math.pi))
    flow = tree.node("ShaderNodeCombineXYZ")
    for key, socket in zip(FLOW, flow.inputs):
        if key in grids:
            tree.put(tree.grid(grids[key]), socket)
    length, cosine = tree.vector("LENGTH", flow.outputs[0]), tree.vector("DOT_PRODUCT", viewer, tree.vector("NORMALIZE", flow.outputs[0]))
    if "flow" not in grids:
        return tree.math("MULTIPLY", length, tree.math("MULTIPLY", phase(tree, cosine, ALIKE), 1.0 / ALIKE))
    whole = tree.grid(grids["flow"])
    mean = tree.math("MAXIMUM", tree.math("MINIMUM", tree.math("DIVIDE", length, whole), 0.9), 0.0)
    return tree.math("MULTIPLY", whole, phase(tree, cosine, mean))


def harmonic(tree, direction, number):
    """A harmonic in a direction."""
    factor, powers = HARMONICS[number]
    if number == 0:
        return factor
    split = tree.node("ShaderNodeSeparateXYZ")
    tree.put(direction, split.inputs[0])
    terms = []
    for exponents, weight in powers.items():
        factors = [split.outputs[axis] for axis in range(3) for _ in range(exponents[axis])]
        term = weight * factor
        for one in factors:
            term = tree.math("MULTIPLY", one, term)
        terms.append(term)
    return tree.total(terms)
