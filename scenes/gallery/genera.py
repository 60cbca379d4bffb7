"""The README's row of cloud genera, rendered with Cycles: `.venv/bin/python -I scenes/gallery/genera.py` (after `make build`).

The same balls (`scenes/cumulus.gltf`) smooth and with two kinds of detail; the same deck (a slab) with three. The sky, the sun and the
material are those of `render.py`. Takes about ten minutes on two cores; `--samples 8 --scale 50` gives a draft.

`CLOUDVDB=/another/cloudvdb` names another binary, as for the tests. Nothing is written but the picture.
"""
import argparse
import base64
import json
import math
import os
import struct
import subprocess
import sys
import tempfile

import bpy
import numpy as np
from mathutils import Vector

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import render as gallery

SIZE = (400, 300)
GAP = 6
SIDE = 4800.0  # of the decks, m
# Detail, medium (for decks), where the camera stands, what it looks at, its angle, by how many stops it is brightened.
HEAP = ((-150.0, -2150.0, 150.0), (-20.0, 0.0, 580.0), 28.5, 0.0)
GENERA = [
    ("none", None, *HEAP),
    ("humilis", None, *HEAP),
    ("congestus", None, *HEAP),
    ("stratocumulus:size=200", {"preset": "stratus"}, (0.0, -900.0, -800.0), (0.0, 900.0, 60.0), 60.0, -0.6),
    ("altocumulus:size=110", {"preset": "stratus"}, (0.0, -900.0, -900.0), (0.0, 900.0, 100.0), 60.0, 0.0),
    ("cirrus:size=170", {"sigma_t": 0.006, "albedo": 0.9999, "g": 0.77}, (0.0, -900.0, -900.0), (0.0, 900.0, 60.0), 60.0, 0.0),
]


def deck(path, medium):
    """A slab as a glTF file: a flat box, whose sides are the deck's tile."""
    half = (SIDE / 2, 100.0, SIDE / 2)
    points = struct.pack("<24f", *(s * h for i in range(8) for s, h in zip((1 if i & bit else -1 for bit in (1, 2, 4)), half)))
    corners = (0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5)
    data = points + struct.pack("<36H", *corners)
    json.dump({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "Deck", "mesh": 0, "extras": {"cloudvdb": dict(medium, shape="slab")}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [-h for h in half], "max": half},
                      {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 72}],
        "buffers": [{"byteLength": 168, "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
    }, open(path, "w"))


def voxelise(number, detail, medium, folder):
    scene = gallery.SCENE
    if medium:
        scene = os.path.join(folder, f"{number}.gltf")
        deck(scene, medium)
    command = os.environ.get("CLOUDVDB", os.path.join(gallery.ROOT, "target", "release", "cloudvdb"))
    path = os.path.join(folder, f"{number}.vdb")
    done = subprocess.run([command, scene, "-o", path, "--density", "source", "--detail", detail, "--max-voxels", "6M", "--json", "-q"],
                          check=True, stdout=subprocess.PIPE)
    return path, json.loads(done.stdout)


def look(position, target, angle):
    camera = bpy.context.scene.camera
    camera.location = position
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = (Vector(target) - Vector(position)).to_track_quat("-Z", "Y")
    camera.data.angle = math.radians(angle)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--scale", type=int, default=100, help="percent of 400x300 each")
    parser.add_argument("--only", type=int, action="append", help="numbers of the pictures, from 0")
    parser.add_argument("-o", "--output", default=os.path.join(HERE, "genera.png"))
    arguments = parser.parse_args()
    gallery.SIZE = SIZE
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for number in arguments.only or range(len(GENERA)):
            detail, medium, position, target, angle, brighter = GENERA[number]
            gallery.layout()
            gallery.sky()
            if medium:
                bpy.data.objects.remove(bpy.data.objects["Ground"])
            look(position, target, angle)
            path, report = voxelise(number, detail, medium, folder)
            gallery.cloud(path, report)
            path = os.path.join(folder, f"{number}.png")
            gallery.render(arguments.samples, path, arguments.scale, brighter)
            pictures.append(gallery.pixels(path))
        rows = [pictures[i:i + 3] for i in range(0, len(pictures), 3)]
        across = lambda row: np.concatenate([p for i, one in enumerate(row) for p in ([np.ones((one.shape[0], GAP, 4), np.float32)] if i else []) + [one]], axis=1)
        # Blender's first row is the lowest.
        rows = [across(row) for row in rows][::-1]
        whole = np.concatenate([p for i, row in enumerate(rows) for p in ([np.ones((GAP, row.shape[1], 4), np.float32)] if i else []) + [row]], axis=0)
        image = bpy.data.images.new("Genera", whole.shape[1], whole.shape[0], alpha=False)
        image.colorspace_settings.name = "Non-Color"
        image.pixels[:] = whole.ravel()
        bpy.context.scene.render.image_settings.compression = 100
        image.filepath_raw, image.file_format = arguments.output, "PNG"
        image.save(quality=100)


if __name__ == "__main__":
    main()
