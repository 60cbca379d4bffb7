"""Writes small glTF files by hand, and reads what the command writes: no Blender needed."""
import base64
import json
import pathlib
import struct

import numpy as np


def octahedron(detail=2):
    """A unit sphere: an octahedron, its faces divided `detail` times. Vertices and triangles."""
    v = [np.array(p, float) for p in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
    f = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(detail):
        seen, finer = {}, []

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in seen:
                m = v[a] + v[b]
                v.append(m / np.linalg.norm(m))
                seen[key] = len(v) - 1
            return seen[key]

        for a, b, c in f:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        f = finer
    return np.array(v, np.float32), np.array(f, np.uint16)


def document(nodes, extras=None, meshes=True, sun=True, materials=None):
    """A glTF as (dict, bytes of the buffer). Mesh 0 is a unit sphere. `nodes` are glTF nodes (Y up)."""
    vertices, faces = octahedron()
    blob = vertices.tobytes() + faces.tobytes()
    nodes = [dict(node) for node in nodes]
    gltf = {"asset": {"version": "2.0"}, "scene": 0}
    if meshes:
        gltf.update({
            "meshes": [{"name": "Ball", "primitives": [dict({"attributes": {"POSITION": 0}, "indices": 1},
                                                            **({"material": 0} if materials else {}))]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3",
                 "min": vertices.min(axis=0).tolist(), "max": vertices.max(axis=0).tolist()},
                {"bufferView": 1, "componentType": 5123, "count": faces.size, "type": "SCALAR"}],
            "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": vertices.nbytes},
                            {"buffer": 0, "byteOffset": vertices.nbytes, "byteLength": faces.nbytes}],
            "buffers": [{"byteLength": len(blob)}]})
    if materials:
        gltf["materials"] = materials
    if sun:
        gltf["extensionsUsed"] = ["KHR_lights_punctual"]
        gltf["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 2049.0}]}}
        # Shines along its -Z: down and to -x here.
        nodes.append({"name": "Sun", "rotation": [-0.6, 0.2, 0.15, 0.7599342], "extensions": {"KHR_lights_punctual": {"light": 0}}})
    gltf["nodes"] = nodes
    gltf["scenes"] = [{"nodes": list(range(len(nodes))), **({"extras": extras} if extras else {})}]
    return gltf, blob if meshes else b""


def add_ground(gltf, blob, z=0.0, albedo=0.5, half_size=100.0, name="Ground"):
    """A square at the height `z` of Blender's frame, Lambertian (base colours of glTF are linear). Returns the buffer."""
    corners = np.array([(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], np.float32) * np.float32(half_size) + np.float32((0, z, 0))
    faces = np.array([0, 1, 2, 0, 2, 3], np.uint16)
    for key in ("meshes", "accessors", "bufferViews", "buffers", "materials"):
        gltf.setdefault(key, [])
    view, accessor = len(gltf["bufferViews"]), len(gltf["accessors"])
    for part in (corners, faces):
        gltf["bufferViews"].append({"buffer": 0, "byteOffset": len(blob), "byteLength": part.nbytes})
        blob += part.tobytes()
    gltf["buffers"] = [{"byteLength": len(blob)}]
    gltf["accessors"] += [{"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3",
                           "min": corners.min(axis=0).tolist(), "max": corners.max(axis=0).tolist()},
                          {"bufferView": view + 1, "componentType": 5123, "count": 6, "type": "SCALAR"}]
    gltf["materials"].append({"name": name, "pbrMetallicRoughness": {"baseColorFactor": [albedo] * 3 + [1.0], "metallicFactor": 0.0}})
    gltf["meshes"].append({"name": name, "primitives": [{"attributes": {"POSITION": accessor}, "indices": accessor + 1,
                                                        "material": len(gltf["materials"]) - 1}]})
    gltf["scenes"][0]["nodes"].append(len(gltf["nodes"]))
    gltf["nodes"].append({"name": name, "mesh": len(gltf["meshes"]) - 1})
    return blob


def add_lamp(gltf, position, intensity, name="Lamp", **more):
    """A point light at a place of Blender's frame, W/sr; with `more` of glTF's keys it is another kind."""
    lights = gltf.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {}).setdefault("lights", [])
    x, y, z = position
    gltf["scenes"][0]["nodes"].append(len(gltf["nodes"]))
    gltf["nodes"].append({"name": name, "translation": [x, z, -y], "extensions": {"KHR_lights_punctual": {"light": len(lights)}}})
    lights.append({"type": "point", "intensity": 683.0 * intensity, **more})


def ball(name="Cloud", centre=(0, 0, 0), radius=1.0, **medium):
    """A node that is a ball; centre in Blender's frame (Z up). A medium goes to its extras."""
    x, y, z = centre
    node = {"name": name, "mesh": 0, "translation": [x, z, -y], "scale": [radius] * 3}
    if medium:
        node["extras"] = {"cloudvdb": medium}
    return node


def volume(file, name="Smoke", **medium):
    """A node that names a VDB, and leaves it where it is."""
    return {"name": name, "extras": {"cloudvdb": {"shape": "vdb", "file": str(file), **medium}}}


def write(path, gltf, blob=b""):
    """.gltf (embedded) or .glb by the extension."""
    path = pathlib.Path(path)
    gltf = json.loads(json.dumps(gltf))
    if path.suffix == ".glb":
        text = json.dumps(gltf).encode()
        text += b" " * (-len(text) % 4)
        blob = blob + b"\0" * (-len(blob) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        if blob:
            chunks += struct.pack("<II", len(blob), 0x004E4942) + blob
        path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)
    else:
        if blob:
            gltf["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
        path.write_text(json.dumps(gltf))
    return path


def scene(path, *nodes, **options):
    return write(path, *document(nodes, **options))


def read(path):
    """The JSON of a .gltf or .glb."""
    data = pathlib.Path(path).read_bytes()
    if data[:4] != b"glTF":
        return json.loads(data)
    length, kind = struct.unpack_from("<II", data, 12)
    assert kind == 0x4E4F534A
    return json.loads(data[20:20 + length])


def world_matrices(gltf):
    """{node index: 4x4 world matrix} in glTF's frame."""
    out = {}

    def local(node):
        if "matrix" in node:
            return np.array(node["matrix"], float).reshape(4, 4).T
        m = np.eye(4)
        x, y, z, w = node.get("rotation", (0, 0, 0, 1))
        m[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
        m[:3, :3] *= np.array(node.get("scale", (1, 1, 1)))[None, :]
        m[:3, 3] = node.get("translation", (0, 0, 0))
        return m

    def walk(index, parent):
        node = gltf["nodes"][index]
        out[index] = parent @ local(node)
        for child in node.get("children", ()):
            walk(child, out[index])

    for index in gltf["scenes"][gltf.get("scene", 0)]["nodes"]:
        walk(index, np.eye(4))
    return out


def z_up(p):
    """glTF's (x, y, z) in Blender's frame."""
    return np.array([p[0], -p[2], p[1]])
