"""Random families of metaballs, the extension that describes them, and the surface that Blender makes of them. Inside Blender only."""
import math
import random

import bpy
from kit import start
from mathutils import Matrix, Quaternion, Vector

KINDS = ("BALL", "CAPSULE", "PLANE", "ELLIPSOID", "CUBE")
Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


def turn(chance):
    q = Quaternion([chance.gauss(0, 1) for _ in range(4)])
    q.normalize()
    return q


def element(ball, chance, kind, negative):
    one = ball.elements.new(type=kind)
    one.co = [chance.uniform(-1, 1) for _ in range(3)]
    one.radius = chance.uniform(0.8, 1.6)
    one.stiffness = chance.choice((2.0, chance.uniform(1.0, 4.0), 12.0))
    one.use_negative = negative
    one.rotation = turn(chance)
    one.size_x, one.size_y, one.size_z = (chance.uniform(0.4, 1.2) for _ in range(3))
    return one


def family(seed):
    """A family of one to three objects, all kinds of elements in turn; what Blender makes of it."""
    start()
    chance = random.Random(seed)
    threshold = chance.choice((0.6, chance.uniform(0.1, 0.9)))
    objects = []
    for number in range(1 if seed % 3 else chance.randint(2, 3)):
        ball = bpy.data.metaballs.new("Cloud")
        # The first object's threshold holds for all.
        ball.threshold = threshold if number == 0 else 0.33
        ball.resolution = 0.08
        thing = bpy.data.objects.new("Cloud" if number == 0 else f"Cloud.{number:03}", ball)
        bpy.context.scene.collection.objects.link(thing)
        scale = [chance.uniform(0.7, 1.5) for _ in range(3)] if seed % 2 else [chance.uniform(0.7, 1.5)] * 3
        thing.matrix_world = Matrix.LocRotScale([chance.uniform(-2, 2) for _ in range(3)], turn(chance), Vector(scale))
        element(ball, chance, KINDS[seed % len(KINDS)] if number == 0 else chance.choice(KINDS), False)
        for _ in range(chance.randint(0, 3)):
            element(ball, chance, chance.choice(KINDS), chance.random() < 0.25)
        objects.append(thing)
    bpy.context.view_layer.update()
    basis = objects[0].evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = basis.to_mesh()
    world = basis.matrix_world
    vertices = [list(world @ v.co) for v in mesh.vertices] if mesh else []
    normals = [list((world.to_3x3().inverted().transposed() @ v.normal).normalized()) for v in mesh.vertices] if mesh else []
    keep = max(1, math.ceil(len(vertices) / 48))
    return {"nodes": [node(thing) for thing in objects], "vertices": vertices[::keep], "normals": normals[::keep]}


def node(thing):
    """The object as a glTF node with the extension: Y up."""
    matrix = Y_UP @ thing.matrix_world @ Y_UP.inverted()
    elements = []
    for one in thing.data.elements:
        q = one.rotation
        elements.append({
            "type": one.type, "co": [one.co.x, one.co.z, -one.co.y], "radius": one.radius, "stiffness": one.stiffness,
            "negative": one.use_negative, "size": [one.size_x, one.size_z, one.size_y], "rotation": [q.x, q.z, -q.y, q.w]})
    extension = {"threshold": thing.data.threshold, "elements": elements}
    return {"name": thing.name, "matrix": [matrix[row][column] for column in range(4) for row in range(4)],
            "extensions": {"CLOUDVDB_metaballs": extension}}
