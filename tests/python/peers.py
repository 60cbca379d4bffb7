"""One scene in cloudvdb, in Cycles and in Mitsuba: the translations, and how each is run.

A scene is a dict in Blender's frame and in metres:

    {"balls": [{"centre", "radius", "sigma", "albedo", "g"}, ...]              these; an "emission", RGB, where they shine (not for Mitsuba)
     "vdb": path, "voxel": h, "sigma", "albedo", "g",                          and/or a grid named density,
     "values": array, "origin": centre of values[0, 0, 0],                     what is in it (for Mitsuba),
     "flame": what a sample of 1 of its grid of that name emits, RGB, where it has one (not for Mitsuba),
     "place": 4 x 4, laid on the grid by the file's transform, or None,
     "sun": {"direction", "irradiance", "angle"}, "sky": radiance, "sky_image": path of an EXR in its place, or None,
     "ground": {"z", "albedo", "half_size"} or None,
     "haze": {"sigma", "albedo", "g", "base", "top", "half_size"} or None,     even air; ours knows no half size
     "lamps": [{"position", "intensity"}, ...]                                 points, W/sr; where there are any
     "camera": {"position", "look_at", "fov_x"}, "width", "height"}

Every renderer gives radiance, height x width x 3, row 0 at the top. What to know about them:

* Cycles 4.5 has no bias in homogeneous volumes; grids it marches (1 to 2 % low where a cloud is dense). 5.2 has none.
* Mitsuba has no overlapping media (balls in haze are of its albedo and g, and as dense as both) and no sun's disc: its sun is a point, so shadows have no penumbra.
"""
import dataclasses
import importlib.util
import json
import math
import os
import pathlib

import numpy as np

import command
import gltf
import vdbinfo
from blender import blender

BOUNCES = 256
SUN = {"direction": (0.8, 0.4, -0.6), "irradiance": 3.0, "angle": 0.00918}


# Two balls and their beams in a layer of haze above a ground, against the sun.
BEAMS = {"balls": [{"centre": centre, "radius": radius, "sigma": 9.0, "albedo": 0.95, "g": 0.6}
                   for centre, radius in (((-0.6, 0.2, 1.0), 0.6), ((0.8, 0.4, 1.1), 0.5))],
         "haze": {"sigma": 0.12, "albedo": 0.95, "g": 0.6, "base": -1.0, "top": 2.0, "half_size": 100.0},
         "sun": {"direction": (0.2, -0.75, -0.6), "angle": 1e-4}, "ground": {"z": -0.8, "albedo": 0.5}}


def deck():
    """Beams between the clouds of scenes/sunbeams.gltf: a ball for each that meets no other, as Mitsuba asks, in haze in which dark things
    are seen from 9 km; seen from below, against the sun."""
    layout = json.loads((pathlib.Path(__file__).parents[2] / "scenes/sunbeams.gltf").read_text())
    balls = []
    for node in layout["nodes"]:
        if not node["name"].startswith("Cloud"):
            continue
        x, y, z = node["translation"]
        ball = {"centre": (x, -z, y), "radius": 0.7 * node["scale"][0], "sigma": 0.05, "albedo": 0.99, "g": 0.85}
        if all(math.dist(b["centre"], ball["centre"]) > b["radius"] + ball["radius"] for b in balls):
            balls.append(ball)
    return {"balls": balls, "ground": {"z": 0.0, "albedo": 0.15, "half_size": 3e4},
            "haze": {"sigma": 3.912 / 9000, "albedo": 0.99, "g": 0.85, "base": -10.0, "top": 3000.0, "half_size": 3e4},
            "sun": {"direction": (0.0, -math.cos(math.radians(33)), -math.sin(math.radians(33))), "angle": 1e-4},
            "camera": {"position": (0.0, -1500.0, 60.0), "look_at": (0.0, 900.0, 560.0), "fov_x": math.radians(62)}}


@dataclasses.dataclass
class Shots:
    """Pictures of one scene, one a seed."""
    images: np.ndarray
    seconds: list
    errors: np.ndarray = None       # standard errors a pixel, where the renderer states them
    layers: dict = None             # of the last picture


def described(width=32, height=24, sun=SUN, sky=0.0, ground=None, camera=None, **media):
    """A scene with what is not said filled in. `sun=None`: no sun."""
    return {"sun": dict(SUN, irradiance=0.0) if sun is None else {**SUN, **sun}, "sky": sky,
            "ground": {"half_size": 100.0, **ground} if ground else None, "width": width, "height": height,
            "camera": {"position": (0.0, -5.2, 0.2), "look_at": (0.0, 0.0, 0.2), "fov_x": 0.75, **(camera or {})}, **media}


def ball(centre, radius, sigma, albedo=0.999, g=0.85):
    return {"centre": centre, "radius": radius, "sigma": sigma, "albedo": albedo, "g": g}


def grid(path, values, voxel, origin, sigma=25.0, albedo=0.999, g=0.85, place=None, **others):
    """Writes `values` (x, y, z), whose first sample is at `origin` before `place` is laid on it; returns the media part of a scene."""
    vdbinfo.write_values(path, values, voxel, origin, place, **others)
    return {"vdb": str(path), "voxel": voxel, "values": values, "origin": tuple(origin), "sigma": sigma, "albedo": albedo, "g": g,
            "place": None if place is None else np.array(place).tolist()}


# ------------------------------------------------------------------------------------------------------------- Cycles

CYCLES = """
stage(given["scene"])
arrays["images"], out["seconds"] = shots(given["scene"]["width"], given["scene"]["height"], given["samples"], given["seeds"],
                                         given["bounces"], given["step_rate"], given["denoised"])
out["version"] = bpy.app.version_string
"""


def plain(scene):
    return {k: v for k, v in scene.items() if k not in ("values", "origin")}


def cycles(scene, samples, seeds=8, bounces=BOUNCES, step_rate=0.5, python=None, denoised=False, timeout=3000):
    """Pictures for seeds 0 to `seeds` - 1 (or the seeds listed), by bpy 4.5 or the Blender of another `python`."""
    seeds = list(range(seeds)) if isinstance(seeds, int) else list(seeds)
    out = blender(CYCLES, timeout=timeout, python=python, scene=plain(scene), samples=samples, seeds=seeds, bounces=bounces,
                  step_rate=step_rate, denoised=denoised)
    return Shots(out["arrays"]["images"], out["seconds"])


def newer_blender():
    """A Python with bpy 5.2, or None: it needs Python 3.13, so it has an environment of its own."""
    return os.environ.get("CLOUDVDB_BPY52") or None


# ------------------------------------------------------------------------------------------------------------ Mitsuba

MITSUBA = """
import json, math, time
import numpy as np, mitsuba as mi
mi.set_variant("scalar_rgb")
from mitsuba import ScalarTransform4f as T
given = json.load(open("given.json"))
out, arrays = {}, {}
s = given["scene"]

def colour(x): return {"type": "rgb", "value": float(x)}
def medium(of, sigma_t): return {"type": "homogeneous", "albedo": of["albedo"], "sigma_t": sigma_t, "phase": {"type": "hg", "g": of["g"]}}

parts = {"type": "scene", "integrator": {"type": "volpath", "max_depth": given["bounces"] + 1, "rr_depth": 1000000}}
eye = s["camera"]
parts["sensor"] = {"type": "perspective", "fov": math.degrees(eye["fov_x"]), "fov_axis": "x",
    "to_world": T().look_at(origin=eye["position"], target=eye["look_at"], up=[0, 0, 1]), "sampler": {"type": "independent"},
    "film": {"type": "hdrfilm", "width": s["width"], "height": s["height"], "rfilter": {"type": "box"}, "pixel_format": "rgb"}}
if s["sun"]["irradiance"] > 0:
    parts["sun"] = {"type": "directional", "direction": s["sun"]["direction"], "irradiance": colour(s["sun"]["irradiance"])}
if s.get("sky_image"):
    # Mitsuba's own Z, Y and X are our X, Z and Y.
    parts["sky"] = {"type": "envmap", "filename": s["sky_image"], "to_world": T().rotate([3**-0.5] * 3, 120)}
elif s["sky"] > 0: parts["sky"] = {"type": "constant", "radiance": colour(s["sky"])}
for i, lamp in enumerate(s.get("lamps") or ()):
    parts[f"lamp{i}"] = {"type": "point", "position": lamp["position"], "intensity": colour(lamp["intensity"])}
if s["ground"]:
    g = s["ground"]
    parts["ground"] = {"type": "rectangle", "to_world": T().translate([0, 0, g["z"]]).scale(g["half_size"]),
                       "bsdf": {"type": "diffuse", "reflectance": colour(g["albedo"])}}
haze, around = s.get("haze"), {}
if haze:
    parts["air"] = medium(haze, haze["sigma"])
    low, high = haze["base"], haze["top"]
    size = T().translate([0, 0, (low + high) / 2]).scale([haze["half_size"], haze["half_size"], (high - low) / 2])
    parts["haze"] = {"type": "cube", "to_world": size, "bsdf": {"type": "null"}, "interior": {"type": "ref", "id": "air"}}
    around = {"exterior": {"type": "ref", "id": "air"}}
    parts["sensor"]["medium"] = {"type": "ref", "id": "air"}
for i, b in enumerate(s.get("balls") or ()):
    assert not haze or (haze["albedo"], haze["g"]) == (b["albedo"], b["g"])
    inside = medium(b, b["sigma"] + (haze["sigma"] if haze else 0.0))
    parts[f"ball{i}"] = {"type": "sphere", "center": b["centre"], "radius": b["radius"], "bsdf": {"type": "null"}, "interior": inside, **around}
if s.get("vdb"):
    values, h = np.load(given["values"]), s["voxel"]
    low, size = np.array(s["origin"]) - h / 2, np.array(values.shape) * h
    texture = mi.VolumeGrid(np.ascontiguousarray(values.transpose(2, 1, 0)[..., None], np.float32))
    place = T() if s["place"] is None else T(s["place"])
    inside = {"type": "heterogeneous", "albedo": s["albedo"], "scale": s["sigma"], "phase": {"type": "hg", "g": s["g"]},
              "sigma_t": {"type": "gridvolume", "grid": texture, "filter_type": "trilinear",
                          "to_world": place @ T().translate(low.tolist()).scale(size.tolist())}}
    parts["cloud"] = {"type": "cube", "bsdf": {"type": "null"}, "interior": inside,
                      "to_world": place @ T().translate((low + size / 2).tolist()).scale((size / 2).tolist())}
scene = mi.load_dict(parts)
mi.render(scene, spp=1, seed=10**6)
images, out["seconds"] = [], []
for seed in given["seeds"]:
    begin = time.perf_counter()
    images.append(np.array(mi.render(scene, spp=given["samples"], seed=seed))[..., :3])
    out["seconds"].append(time.perf_counter() - begin)
arrays["images"] = np.array(images)
"""


def has_mitsuba():
    """`make crosscheck` installs it; `make test` does without."""
    return importlib.util.find_spec("mitsuba") is not None


def mitsuba(scene, samples, seeds=8, bounces=BOUNCES, timeout=3000):
    """Pictures by Mitsuba 3's volpath, variant scalar_rgb."""
    seeds = list(range(seeds)) if isinstance(seeds, int) else list(seeds)
    balls = scene.get("balls") or ()
    for i, a in enumerate(balls):
        for b in balls[:i]:
            if math.dist(a["centre"], b["centre"]) < a["radius"] + b["radius"]:
                raise ValueError("Mitsuba has no overlapping media")
    given = {k: v for k, v in scene.items() if k != "values"}
    path = None
    if scene.get("vdb"):
        path = str(pathlib.Path(scene["vdb"]).with_suffix(".values.npy").resolve())
        np.save(path, np.asarray(scene["values"], np.float32))
    out = blender(MITSUBA, timeout=timeout, prelude="", scene=given, values=path, samples=samples, seeds=seeds, bounces=bounces)
    return Shots(out["arrays"]["images"], out["seconds"])


# ----------------------------------------------------------------------------------------------------------- cloudvdb

def numbers(values):
    return ",".join(repr(float(v)) for v in values)


def layout(scene, path):
    """The media and the ground of a scene as glTF; light and camera are said on the command line."""
    nodes = [gltf.ball(f"Ball.{i}", b["centre"], b["radius"], sigma_s=b["sigma"] * b["albedo"],
                       sigma_a=b["sigma"] * (1 - b["albedo"]), g=b["g"],
                       **({"emission": b["emission"]} if "emission" in b else {})) for i, b in enumerate(scene.get("balls") or ())]
    if scene.get("vdb"):
        path = pathlib.Path(path)
        file = os.path.relpath(pathlib.Path(scene["vdb"]).resolve(), path.parent.resolve())
        burns = {"emission_grid": "flame", "emission": scene["flame"]} if scene.get("flame") else {}
        nodes.append(gltf.volume(file, sigma_t=scene["sigma"], albedo=scene["albedo"], g=scene["g"], **burns))
    document, blob = gltf.document(nodes)
    for lamp in scene.get("lamps") or ():
        gltf.add_lamp(document, lamp["position"], lamp["intensity"])
    if scene["ground"]:
        blob = gltf.add_ground(document, blob, **scene["ground"])
    return gltf.write(path, document, blob)


def flags(scene):
    """What a scene says beside its media."""
    sun, eye = scene["sun"], scene["camera"]
    out = ["--sun", numbers(sun["direction"]), "--irradiance", sun["irradiance"], "--sun-angle", sun["angle"],
           "--sky", scene.get("sky_image") or scene["sky"], "--camera", numbers(eye["position"]), "--look-at", numbers(eye["look_at"]),
           "--fov", math.degrees(eye["fov_x"]), "--size", f"{scene['width']}x{scene['height']}"]
    if scene.get("haze"):
        air = scene["haze"]
        out += ["--atmosphere", f"haze:sigma_t={air['sigma']},albedo={air['albedo']},g={air['g']},base={air['base']},top={air['top']}"]
    if scene.get("vdb") and not scene.get("balls"):
        out += ["--sigma-t", scene["sigma"], "--albedo", scene["albedo"], "-g", scene["g"]]
        if scene.get("flame") and not scene["ground"]:
            out += ["--emission", "flame=" + numbers(scene["flame"])]
    return [f"{a}" for a in out]


def cloudvdb(scene, folder, samples, seeds=1, timeout=3000, threads=2, integrator="path", more=()):
    """Pictures by the command under test, with the standard errors that it states."""
    seeds = list(range(seeds)) if isinstance(seeds, int) else list(seeds)
    folder = pathlib.Path(folder)
    bare = scene.get("vdb") and not (scene.get("balls") or scene["ground"])
    source = scene["vdb"] if bare else layout(scene, folder / "scene.glb")
    images, errors, seconds, layers = [], [], [], None
    for seed in seeds:
        target = folder / f"ours_{seed}.exr"
        ran = command.succeed(source, "-o", target, "--overwrite", "--density", "source", "--integrator", integrator,
                              "--spp", samples, "--seed", seed, "--threads", threads, "-q", *more, *flags(scene), timeout=timeout)
        seconds.append(ran.seconds)
        layers = read_exr(target)
        images.append(layers["Combined"])
        errors.append(layers["StandardError"])
    return Shots(np.array(images), seconds, np.array(errors), layers)


def read_exr(path):
    """The layers of a picture: {name: height x width x 3, or height x width where it has one channel}. A view layer's name
    before them is dropped; plain channels are `Combined` where no layer of that name is there, and the standard error is
    `StandardError` however it is spelt."""
    import OpenEXR

    found = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                pixels = np.array(channel.pixels)
                assert pixels.dtype == np.float32, f"{name} is {pixels.dtype}"
                *layer, last = name.split(".")  # ViewLayer.Combined.R; or R, in a part of its own
                if not layer and len(file.parts) > 1:
                    layer = (part.name() or "").split(".")
                found.setdefault(layer[-1] if layer else "", {})[last.upper()] = pixels.astype(np.float64)
    out = {}
    for layer, channels in found.items():
        if {"R", "G", "B"} <= set(channels):
            out[layer] = np.stack([channels[c] for c in "RGB"], axis=-1)
        else:
            out[layer] = next(iter(channels.values()))
    if "Combined" not in out:
        out["Combined"] = out[""]
    for layer in list(out):
        word = "".join(c for c in layer.lower() if c.isalpha())
        if "standarderror" in word or "stderr" in word:
            out["StandardError"] = out[layer]
    assert "StandardError" in out, f"{path} has no layer of standard errors, only {sorted(found)}"
    return out


def plain_exr(path):
    """R, G and B of a picture without layers."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.stack([np.array(file.channels()[c].pixels, np.float64) for c in "RGB"], axis=-1)


def flux(scene, *options, timeout=600):
    """The energy balance: {quantity: (value, standard error)}."""
    ran = command.succeed("flux", scene, "--json", *options, timeout=timeout)
    told = json.loads(ran.out)
    return {k: (v["value"], v["se"]) for k, v in told.items() if isinstance(v, dict) and {"value", "se"} <= set(v)}
