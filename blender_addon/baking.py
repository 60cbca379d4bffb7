# SPDX-License-Identifier: GPL-3.0-or-later
"""Light in the grids: what the command is asked for, and what its report says to the material."""
import math

import bpy
from mathutils import Vector

from .errors import CloudError


def flags(settings):
    """The command's flags for the panel's Bake Light. Raises `CloudError`."""
    if settings.bake == "none":
        return []
    return ["--bake", settings.bake, *(_view(settings.id_data) if settings.bake == "view" else [])]


def _view(scene):
    """The scene's camera, as the command takes it: the layout's file has none."""
    camera, instead = scene.camera, 'or choose "Any View" as Bake Light'
    if camera is None or camera.type != "CAMERA":
        raise CloudError(f'The scene has no camera for "For this Camera" to bake light for: add one, {instead}')
    if camera.data.type == "ORTHO":
        raise CloudError(f'"{camera.name}" is orthographic, and light is baked for cameras that stand somewhere: make it Perspective, {instead}')
    place = camera.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world
    stands, ahead = place.translation, place.to_3x3() @ Vector((0.0, 0.0, -1.0))
    said = ["--camera", _triple(stands), "--look-at", _triple(stands + ahead.normalized() * max(1.0, 1e-3 * stands.length))]
    if camera.data.type == "PERSP":
        corners = camera.data.view_frame(scene=scene)
        width, height = (max(c[k] for c in corners) - min(c[k] for c in corners) for k in range(2))
        render, share = scene.render, scene.render.resolution_percentage / 100
        said += ["--fov", f"{math.degrees(2 * math.atan(0.5 * width / abs(corners[0].z))):.9g}"]
        # The shape that the camera has, whatever the shape of a pixel.
        columns = max(1, round(render.resolution_x * share))
        said += ["--size", f"{columns}x{max(1, round(columns * height / width))}"]
    return said


def _triple(vector):
    return ",".join(f"{number:.9g}" for number in vector)


def cloud(report, metadata, history=()):
    """What `baked.material` has to know of a cloud, from the command's report and the VDB's metadata; `history` is (frame, report,
    metadata) of each frame of a sequence."""
    albedo = metadata.get("albedo", 1.0)
    sun = {"direction": _direction(metadata)}
    light = _light(report.get("bake"))
    if light and history:
        told = [(frame, _light(said["bake"])["parts"]) for frame, said, _ in history]
        for number, part in enumerate(light["parts"]):
            # What is nowhere in one frame may be somewhere in another.
            for _, parts in told:
                part["grids"].update(parts[number]["grids"])
            part["frames"] = _changes([(frame, {key: parts[number][key] for key in ("scale", "glow")}) for frame, parts in told])
        sun["frames"] = _changes([(frame, _direction(said)) for frame, _, said in history])
    return {"density": report["vdb"]["density_scale"], "albedo": [albedo] * 3, "anisotropy": metadata.get("g", 0.0), "sun": sun, "bake": light,
            "emission": _emission(report, history)}


def _emission(report, history):
    """The grids of what shines by itself; what is dark in some frames has a scale of 0 there."""
    told = [(frame, {grid["name"]: grid for grid in said["vdb"]["emission"]}) for frame, said, _ in history]
    found = {name: grid for _, grids in reversed(told) for name, grid in grids.items()}
    found.update({grid["name"]: grid for grid in report["vdb"]["emission"]})
    return [{**grid, "frames": _changes([(frame, {"scale": grids[name]["scale"] if name in grids else 0.0}) for frame, grids in told])}
            for name, grid in found.items()]


def _changes(frames):
    """(frame, value) of each frame, where not all values are one."""
    return frames if any(value != frames[0][1] for _, value in frames) else []


def _direction(metadata):
    """The way of the sun's light."""
    return [float(number) for number in metadata.get("sun_direction", "0 0 -1").split()]


def alike(first, other):
    """Whether a frame's light can be shown by the material of the first one's."""
    def fixed(report):
        said = report.get("bake") or {"parts": ()}
        return said.get("bake"), round(said.get("g", 0.0), 5), [(part["light"], [round(c, 5) for c in part["tint"]]) for part in said["parts"]]

    tints = [{grid["name"]: [round(c, 5) for c in grid["tint"]] for grid in report["vdb"]["emission"]} for report in (first, other)]
    return fixed(first) == fixed(other) and all(tints[0][name] == tints[1][name] for name in tints[0].keys() & tints[1].keys())


def quality(report):
    """How far baked light is off the path tracer's, by the report; "" where nobody looked."""
    said = report.get("bake")
    if not said or not said["errors"]:
        return ""
    errors = [error["rms"] for error in said["errors"]]
    if said["bake"] == "view":
        return f", baked light off by {100 * errors[0]:.1f} % in blocks of 8 pixels"
    return f", baked light off by {100 * min(errors):.1f} to {100 * max(errors):.1f} % in blocks of 8 pixels, from {len(errors)} sides"


def _light(said):
    """Of each light its colour and scale, and its grids by what they hold."""
    if not said:
        return None

    def grids(part):
        return {grid["term"] if isinstance(grid["term"], str) else str(grid["term"]["harmonic"]): grid["name"]
                for grid in said["grids"] if grid["part"] == part}

    parts = [{**part, "glow": said["lobes"][number], "grids": grids(number)} for number, part in enumerate(said["parts"])]
    return {"bake": said["bake"], "g": said["g"], "parts": parts}


def kind(cloud):
    """The bake that a cloud has, as the panel's Bake Light names it."""
    return cloud["bake"]["bake"] if cloud["bake"] else "none"


def advice(scene, cloud):
    """A sentence on what makes renders of baked light slow."""
    cycles = getattr(scene, "cycles", None)
    if cloud["bake"] and getattr(cycles, "volume_biased", True) is False:
        return ["Baked light renders much faster with Biased ticked, in Cycles' settings of volumes"]
    return []
