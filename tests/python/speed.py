"""Samples a second and noise of one sample, on the cumulus: cloudvdb beside Cycles 4.5, Mitsuba (scalar_rgb) and pbrt-v4.

    python tests/python/speed.py [--repetitions 5] [--samples 16] [--json out.json]

One run, side by side, in turns (what else the machine does meets all alike); medians. cloudvdb's seconds are those of
the whole command, the reading and writing of files included; the others' are those of the picture alone (pbrt's: of its
command). The noise is that between two seeds, over pixels above 2 % of the brightest: its square times the seconds says
who is first at a given error. pbrt-v4 takes part where CLOUDVDB_PBRT names its command, Blender 5.2 where
CLOUDVDB_BPY52 names its Python.
"""
import argparse
import json
import math
import os
import pathlib
import statistics
import subprocess
import tempfile
import time

import numpy as np

import cumulus
import peers


def scene(folder, cells=128, width=192, height=144):
    values, voxel, origin = cumulus.values(cells)
    return peers.described(width=width, height=height, **peers.grid(folder / "cumulus.vdb", values, voxel, origin))


def contenders(described, folder, samples):
    """{name: function of seeds that returns peers.Shots}."""
    out = {"cloudvdb": lambda seeds: peers.cloudvdb(described, folder, samples, seeds),
           "Cycles 4.5": lambda seeds: peers.cycles(described, samples, seeds, step_rate=1.0)}
    if peers.has_mitsuba():
        out["Mitsuba"] = lambda seeds: peers.mitsuba(described, samples, seeds)
    if peers.newer_blender():
        out["Cycles 5.2"] = lambda seeds: peers.cycles(described, samples, seeds, python=peers.newer_blender())
    if os.environ.get("CLOUDVDB_PBRT"):
        out["pbrt-v4"] = lambda seeds: pbrt(described, folder, samples, seeds)
    return out


def measure(described, folder, samples, repetitions, report=lambda text: None):
    """{name: {"seconds", "rate" (samples a second), "sigma" (of one sample, over the mean), "cost" (s to 5 % a pixel)}}."""
    runs = contenders(described, folder, samples)
    seconds, squares, mean = {name: [] for name in runs}, {name: [] for name in runs}, {name: [] for name in runs}
    for repetition in range(repetitions):
        for name, run in runs.items():
            shots = run([2 * repetition, 2 * repetition + 1])
            a, b = shots.images.mean(axis=3)
            assert not np.array_equal(a, b), f"{name} ignores its seed"
            level = (a + b) / 2
            seconds[name] += shots.seconds
            squares[name].append((a - b) ** 2 / 2)
            mean[name].append(level)
            report(f"{name}: {', '.join(f'{s:.2f}' for s in shots.seconds)} s")
    # One mask for all.
    level = np.mean([np.mean(m, axis=0) for m in mean.values()], axis=0)
    cloud = level > 0.02 * level.max()
    out = {}
    for name in runs:
        took = statistics.median(seconds[name])
        sigma = math.sqrt(np.mean(squares[name], axis=0)[cloud].mean() * samples) / level[cloud].mean()
        out[name] = {"seconds": took, "rate": level.size * samples / took, "sigma": sigma,
                     "cost": took / samples * (sigma / 0.05) ** 2, "mean": float(np.mean(mean[name]))}
    return out


def table(found, samples):
    first = found["cloudvdb"] if "cloudvdb" in found else next(iter(found.values()))
    lines = [f"{'':12} {f's for {samples}':>10} {'samples/s':>10} {'rate':>6} {'sigma':>6} {'s to 5 %':>9} {'time x variance':>16}"]
    for name, row in found.items():
        lines.append(f"{name:12} {row['seconds']:10.2f} {row['rate']:10,.0f} {row['rate'] / first['rate']:6.2f} {row['sigma']:6.2f} "
                     f"{row['cost']:9,.0f} {row['cost'] / first['cost']:16.2f}")
    return "\n".join(lines)


# pbrt's samples lie half a voxel inside its box, too.
PBRT = """
Scale -1 1 1
LookAt {eye} {target} 0 0 1
Camera "perspective" "float fov" {fov}
Sampler "independent" "integer pixelsamples" {samples} "integer seed" {seed}
Integrator "volpath" "integer maxdepth" {bounces}
PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
Film "rgb" "integer xresolution" {width} "integer yresolution" {height} "string filename" "{out}"
WorldBegin
LightSource "distant" "point3 from" [{toward}] "point3 to" [0 0 0] "rgb L" [{e} {e} {e}]
MakeNamedMedium "cloud" "string type" "uniformgrid" "integer nx" {n[0]} "integer ny" {n[1]} "integer nz" {n[2]}
  "point3 p0" [{low}] "point3 p1" [{high}] "float g" {g} "float scale" {sigma}
  "spectrum sigma_s" [300 {albedo} 800 {albedo}] "spectrum sigma_a" [300 {rest} 800 {rest}] "float density" [{density}]
MediumInterface "cloud" ""
Material "interface"
Shape "trianglemesh" "point3 P" [{corners}]
  "integer indices" [0 2 1 1 2 3 4 5 6 5 7 6 0 1 4 1 5 4 2 6 3 3 6 7 0 4 2 2 4 6 1 3 5 3 7 5]
"""


def pbrt(described, folder, samples, seeds):
    """pbrt-v4's volpath. Its units of light are its film's, so the picture is brought to the reference's mean: only its
    noise is asked for."""
    values = np.asarray(described["values"])
    low = np.array(described["origin"]) - described["voxel"] / 2
    high = low + np.array(values.shape) * described["voxel"]
    eye, sun = described["camera"], described["sun"]
    width, height = described["width"], described["height"]

    def row(v):
        return " ".join(repr(float(x)) for x in v)

    images, seconds = [], []
    for seed in seeds:
        (folder / "scene.pbrt").write_text(PBRT.format(
            eye=row(eye["position"]), target=row(eye["look_at"]), samples=samples, seed=seed, bounces=peers.BOUNCES, width=width,
            # Its angle is that of the shorter side.
            height=height, fov=2 * math.degrees(math.atan(math.tan(eye["fov_x"] / 2) * min(1.0, height / width))),
            out=folder / "pbrt.exr", toward=row(-np.array(sun["direction"])), e=sun["irradiance"], n=values.shape, low=row(low),
            high=row(high), g=described["g"], sigma=described["sigma"], albedo=described["albedo"], rest=1 - described["albedo"],
            density=" ".join(f"{v:.6g}" for v in values.transpose(2, 1, 0).ravel()),
            corners=row(x for c in range(8) for x in ((high if c >> k & 1 else low)[k] for k in range(3)))))
        begin = time.perf_counter()
        subprocess.run([os.environ["CLOUDVDB_PBRT"], "--quiet", "--nthreads", "2", "scene.pbrt"], cwd=folder, check=True,
                       stdin=subprocess.DEVNULL)
        seconds.append(time.perf_counter() - begin)
        image = peers.plain_exr(folder / "pbrt.exr")
        images.append(image * (MEAN / image.mean()))
    return peers.Shots(np.array(images), seconds)


# The picture's mean radiance, by the reference.
MEAN = 0.04016


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--json", type=pathlib.Path)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        found = measure(scene(folder), folder, asked.samples, asked.repetitions, lambda text: print(text, flush=True))
    print(table(found, asked.samples))
    if asked.json:
        asked.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
