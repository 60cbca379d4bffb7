"""Baked light on the cumulus: how far Cycles' and EEVEE's pictures of it are off, and the seconds, beside Cycles' own.

    python tests/python/bake_error.py [--bakes view sh2 ...] [--samples 768] [--cycles-samples 64] [--json out.json]

96 x 72 pixels, one run side by side (some ten minutes); 4 samples, and of bakes for any view also the 16 that their script sets: against the
sun a bright rim passes through pixels, which 4 samples of a pixel miss by 6 %, whatever the light. The error of a pixel is against two pictures of the path tracer of
`--samples` samples each, whose noise it is free of (`bakes.off`); that of blocks of 8, and the mean, are for the bake's own camera against the
published reference. Cycles' own seconds to the error of the view bake are by its variance: two seeds at `--cycles-samples`, their noise and
seconds, and that noise falls as the root of the samples; its bias (Blender 4.5 marches) is forgiven. The seconds of a render are the median
of three after a first one, by `bpy.ops.render.render`, files and all; EEVEE's, whose picture of 192 x 144 is halved, those of the first,
its shaders and all. Blender 5.2 takes part where CLOUDVDB_BPY52 names its Python.
"""
import argparse
import itertools
import json
import math
import pathlib
import statistics
import tempfile

import numpy as np

import command
import peers
import speed
from bakes import off, shown
from grid_error import blocks, shots

REFERENCE = pathlib.Path(__file__).with_name("cumulus128_reference.json")
#: Cameras that no bake has seen, at the own camera's height and distance: against the sun, with it, and across.
UNSEEN = {"against the sun": (4.651, 2.326, 0.2), "with the sun": (-4.651, -2.326, 0.2), "across": (-2.326, 4.651, 0.2)}
#: What is baked, by how many photons, whether EEVEE shows it too, and by how many samples Cycles does.
BAKES = (("view", "1M", True, (4,)), ("sh2", "1M", False, (4, 16)), ("sh1", "1M", False, (16,)), ("sh2", "4M", False, (4, 16)),
         ("isotropic", "1M", False, (16,)))


def blenders():
    """{name: its Python}."""
    newer = peers.newer_blender()
    return {"4.5": None, **({"5.2": newer} if newer else {})}


def bake(scene, folder, kind, photons):
    """The script of a bake, and the seconds of the whole command; its check is left out."""
    script = folder / f"{kind}.blend.py"
    ran = command.succeed(scene["vdb"], "-o", folder / f"{kind}.vdb", "-o", script, "--overwrite", "-q", "--bake", kind, "--photons", photons,
                          "--no-check", *peers.flags(scene), timeout=600)
    return script, ran.seconds


def truths(scene, folder, samples):
    """Two independent pictures of the path tracer."""
    return shots(scene, folder, "--integrator", "path", "--spp", samples)[0]


def published(image):
    """The relative RMSE of blocks of 8 pixels against the published reference, its noise taken off, and that of the mean."""
    known = json.loads(REFERENCE.read_text())
    truth, doubt = np.array(known["mean"]), np.array(known["standard_error"])
    found, lit = blocks(image, known["block"]), truth > 0.02 * truth.max()
    square = ((found - truth)[lit] ** 2).mean() - (doubt[lit] ** 2).mean()
    return math.sqrt(max(square, 0.0)) / truth[lit].mean(), found.mean() / truth.mean() - 1


def halved(images):
    return [blocks(image.mean(axis=2).astype(float), 2) for image in images]


def grey(images):
    return [image.mean(axis=2).astype(float) for image in images]


def measure(folder, kinds, samples, own_samples, tell):
    """Rows of the table, of some kinds of bakes, and Cycles' own seconds to the error of the view bake."""
    scene = speed.scene(folder, width=96, height=72)
    rows, own = [], {}

    def row(bake, camera, engine, seconds, image, truth, kind=None):
        pixel, mean = off(image, truth)
        block = off(image, truth, 8)[0]
        if kind == "view":
            block, mean = published(image)
        rows.append({"bake": bake, "camera": camera, "engine": engine, "seconds": seconds, "pixel": pixel, "block": block, "mean": mean})
        tell(line(rows[-1]))
        return pixel

    wanted = {**({"own": scene["camera"]["position"]} if "view" in kinds else {}), **(UNSEEN if set(kinds) - {"view"} else {})}
    truth = {name: truths({**scene, "camera": {**scene["camera"], "position": place}}, folder, samples) for name, place in wanted.items()}
    for kind, photons, eevee, shown_by in (row for row in BAKES if row[0] in kinds):
        script, took = bake(scene, folder, kind, photons)
        label = f"{kind}, {photons} photons, {took:.1f} s"
        places = {"own": None} if kind == "view" else UNSEEN
        for (version, python), shots_of in itertools.product(blenders().items(), shown_by):
            found = shown(script, samples=shots_of, places=list(places.values()), shots=4 if kind == "view" else 2, python=python)
            each = len(found["seconds"]) // len(places)
            for number, (camera, image) in enumerate(zip(places, grey(found["arrays"]["images"]))):
                seconds = statistics.median(found["seconds"][each * number + 1:each * (number + 1)])
                error = row(label, camera, f"Cycles {version}, {shots_of}", seconds, image, truth[camera], kind)
                if kind == "view":
                    own[version] = by_itself(scene, python, own_samples, sum(truth["own"]) / 2, error)
                    own[version].update(bake=took, render=seconds)
                    tell(sentence(version, own[version], own_samples))
        if not eevee:
            continue
        # EEVEE's froxels are pixels at best: twice the pixels, halved.
        for version, python in blenders().items():
            found = shown(script, samples=16, places=list(places.values()), python=python, eevee=True, scale=2)
            for number, (camera, image) in enumerate(zip(places, halved(found["arrays"]["images"]))):
                row(label, camera, f"EEVEE {version}", found["seconds"][number], image, truth[camera], kind)
    return rows, own


def by_itself(scene, python, samples, level, error):
    """Cycles by itself: seconds and noise of its pictures, and the seconds to an error by their variance."""
    shot = peers.cycles(scene, samples, [0, 1], step_rate=1.0, python=python)
    a, b = grey(shot.images)
    lit = level > 0.02 * level.max()
    noise, seconds = math.sqrt(((a - b)[lit] ** 2).mean() / 2) / level[lit].mean(), statistics.mean(shot.seconds)
    return {"seconds": seconds, "noise": noise, "error": error, "to_error": seconds * (noise / error) ** 2}


def line(row):
    return (f"{row['bake']:30} {row['camera']:16} {row['engine']:14} {row['seconds']:7.2f} s {row['pixel']:7.1%} {row['block']:7.1%} "
            f"{row['mean']:+7.1%}")


def sentence(version, own, samples):
    return (f"Cycles {version} by itself, {samples} samples: {own['seconds']:.1f} s, noise {own['noise']:.1%}; to {own['error']:.1%} by its variance "
            f"{own['to_error']:,.0f} s: {own['to_error'] / (own['bake'] + own['render']):,.0f} times bake and render, "
            f"{own['to_error'] / own['render']:,.0f} times the render")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bakes", nargs="+", choices=["view", "sh2", "sh1", "isotropic"], default=["view", "sh2", "sh1", "isotropic"])
    parser.add_argument("--samples", type=int, default=768)
    parser.add_argument("--cycles-samples", type=int, default=64)
    parser.add_argument("--json", type=pathlib.Path)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print(f"{'bake':30} {'camera':16} {'engine':14} {'render':>9} {'a pixel':>7} {'of 8':>7} {'mean':>7}", flush=True)
        rows, own = measure(pathlib.Path(folder), asked.bakes, asked.samples, asked.cycles_samples, lambda text: print(text, flush=True))
    if asked.json:
        asked.json.write_text(json.dumps({"rows": rows, "own": own}, indent=1) + "\n")


if __name__ == "__main__":
    main()
