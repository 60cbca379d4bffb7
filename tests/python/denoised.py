"""Cycles with its denoiser on the cumulus, beside the grid integrator asked for the errors that it reaches.

    python tests/python/denoised.py [--samples 64 256] [--errors 8 5] [--reference-samples 1024]

192 x 144, one run side by side, two seeds each, in turns. The error of a pixel, noise and bias together, is against two pictures of the path
tracer, whose own noise it is free of (`bakes.off`). Seconds: of the whole command with reading, writing and the pictures by which it finds
its settings; Cycles' of the picture alone. Cycles is Blender 5.2's where CLOUDVDB_BPY52 names its Python, else 4.5's.
"""
import argparse
import pathlib
import statistics
import tempfile

import peers
import speed
from bake_error import grey, truths
from bakes import off
from grid_error import shots


def row(name, seconds, images, truth):
    """A line of the table, and the seconds and the error in it."""
    def mean(size, which):
        return statistics.mean(off(image, truth, size)[which] for image in images)

    print(f"{name:38} {statistics.mean(seconds):7.1f} s {mean(1, 0):7.1%} {mean(4, 0):7.1%} {mean(8, 0):7.1%} {mean(1, 1):+7.1%}", flush=True)
    return statistics.mean(seconds), mean(1, 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, nargs="+", default=[64, 256])
    parser.add_argument("--errors", type=float, nargs="+", default=[8.0, 5.0], help="per cent")
    parser.add_argument("--reference-samples", type=int, default=1024)
    asked = parser.parse_args()
    python, version = peers.newer_blender(), "5.2" if peers.newer_blender() else "4.5"
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scene = speed.scene(folder)
        truth = truths(scene, folder, asked.reference_samples)
        print(f"{'':38} {'seconds':>9} {'a pixel':>7} {'of 4':>7} {'of 8':>7} {'mean':>7}")
        for samples, error in zip(asked.samples, asked.errors):
            shot = peers.cycles(scene, samples, [0, 1], step_rate=1.0, python=python, denoised=True)
            theirs, _ = row(f"Cycles {version}, {samples} samples, denoised", shot.seconds, grey(shot.images), truth)
            images, seconds, _ = shots(scene, folder, "--integrator", "grid", "--error", f"{error:g}%")
            ours, _ = row(f"grid --error {error:g}%", [seconds], images, truth)
            print(f"{'':38} {theirs / ours:7.1f} times", flush=True)


if __name__ == "__main__":
    main()
