"""Sunbeams to 5 % a pixel: `--error 5%` beside the seconds that Cycles and Mitsuba take to that, by the variance of a few samples.

    python tests/python/beams_speed.py [--samples 64] [--size 192x144] [--scene balls deck]

Two balls in a layer of haze above a ground, against the sun; and a broken deck of clouds (`peers.deck`). One run, side by side, two seeds each. Ours is the whole command, with the smaller
pictures by which it finds its settings; its error is against the path tracer's mean of two pictures, free of their noise.
"""
import argparse
import math
import pathlib
import statistics
import tempfile

import numpy as np

import honest
import peers

SCENES = {"balls": lambda: peers.BEAMS, "deck": peers.deck}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--size", default="192x144")
    parser.add_argument("--scene", nargs="*", choices=SCENES, default=list(SCENES))
    options = parser.parse_args()
    for name in options.scene:
        print(f"{name}:", flush=True)
        compare(peers.described(*map(int, options.size.split("x")), **SCENES[name]()), options.samples)


def compare(scene, samples):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        truth = honest.Truth(scene, folder, 1024)
        for integrator in ("grid", "path"):
            runs = [honest.picture(scene, folder, "--integrator", integrator, "--error", "5%", "--seed", seed) for seed in (1, 2)]
            off = math.sqrt(np.mean([truth.off(image)[0] ** 2 for image, _, _ in runs]))
            took = statistics.median(said["wall"] for _, _, said in runs)
            print(f"{integrator + ' --error 5%':16} {took:8.1f} s, error {off:.1%}, to 5 % {took * (off / 0.05) ** 2:8.1f} s", flush=True)
        peer = {"Cycles 4.5": lambda: peers.cycles(scene, samples, [1, 2])}
        if peers.has_mitsuba():
            peer["Mitsuba 3.9"] = lambda: peers.mitsuba(scene, samples, [1, 2])
        for name, run in peer.items():
            shots = run()
            a, b = shots.images @ np.array([0.2126, 0.7152, 0.0722])
            noise = math.sqrt(((a - b)[truth.lit] ** 2).mean() / 2) / truth.level
            took = statistics.median(shots.seconds)
            print(f"{name:16} {took:8.1f} s, noise {noise:.1%}, to 5 % {took * (noise / 0.05) ** 2:8.1f} s", flush=True)


if __name__ == "__main__":
    main()
