"""The grid integrator's whole error on the cumulus, noise and bias, and its seconds beside the path tracer's.

    python tests/python/grid_error.py [--errors 5 2] [--reference-samples 4096]

Pictures of 192 x 144 by `--integrator grid --error E%`, two seeds: their difference is the noise. Blocks of 4 and 8 pixels of their mean
against the path tracer's, both noises taken off, are the bias. The path tracer's seconds to the same noise go by its variance, measured in
the same run.
"""
import argparse
import json
import math
import pathlib
import tempfile

import numpy as np

import command
import peers
import speed


def blocks(image, size):
    height, width = (n // size * size for n in image.shape)
    return image[:height, :width].reshape(height // size, size, width // size, size).mean(axis=(1, 3))


def bias(images, truth, variance, size):
    """Relative RMSE of blocks of the mean of two images against `truth` with a variance a pixel; both noises taken off."""
    a, b = images
    found, level, doubt = blocks((a + b) / 2, size), blocks(truth, size), blocks(variance, size) / size**2
    lit = level > 0.02 * level.max()
    noise = (blocks(a - b, size)[lit] ** 2).mean() / 4
    square = ((found - level)[lit] ** 2).mean() - doubt[lit].mean() - noise
    return math.sqrt(max(square, 0.0)) / level[lit].mean()


def shots(scene, folder, *arguments):
    """Two seeds' pictures, grey, with the seconds of each and what the report says."""
    images, seconds, report = [], [], {}
    for seed in (1, 2):
        target = folder / f"{seed}.exr"
        ran = command.succeed(scene["vdb"], "-o", target, "-o", folder / "report.json", "--overwrite", "--density", "source", "--seed", seed,
                              "-q", *arguments, *peers.flags(scene), timeout=3000)
        seconds.append(ran.seconds)
        images.append(peers.read_exr(target)["Combined"].mean(axis=2).astype(float))
        report = json.loads((folder / "report.json").read_text())["render"]
    return images, min(seconds), report


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--errors", type=float, nargs="+", default=[5.0, 2.0], help="per cent")
    parser.add_argument("--reference-samples", type=int, default=4096)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scene = speed.scene(folder)
        (a, b), seconds, _ = shots(scene, folder, "--integrator", "path", "--spp", options.reference_samples // 2)
        truth, variance = (a + b) / 2, (a - b) ** 2 / 4
        lit = truth > 0.02 * truth.max()
        # What the path tracer takes to a noise of 1.
        cost = seconds * ((a - b)[lit] ** 2).mean() / 2 / truth[lit].mean() ** 2
        print(f"path: {seconds:.1f} s for {options.reference_samples // 2} samples a pixel")
        for error in options.errors:
            images, seconds, report = shots(scene, folder, "--integrator", "grid", "--error", f"{error}%")
            noise = math.sqrt(((images[0] - images[1])[lit] ** 2).mean() / 2) / truth[lit].mean()
            mean = (images[0] + images[1])[lit].mean() / 2 / truth[lit].mean() - 1
            ours = cost / noise**2
            print(f"grid to {error:g} %: {seconds:.1f} s, {report['photons']['emitted']} photons, {report['spp']} samples; noise {noise:.2%} "
                  f"(stated {report['relative_error']:.2%}), blocks of 4 {bias(images, truth, variance, 4):.2%}, of 8 "
                  f"{bias(images, truth, variance, 8):.2%}, mean {mean:+.2%}; path to that noise {ours:.0f} s, {ours / seconds:.0f} times")


if __name__ == "__main__":
    main()
