"""The study of the cumulus of 128^3 cells, with Cycles and Mitsuba beside it where they are installed.

    python tests/python/study_peers.py out/study [--samples 16 64] [--reference 768] [--quick]

Their seconds are those of the picture alone, the median of two seeds; ours are those of a picture in the study.
"""
import argparse
import pathlib
import statistics
import subprocess

import numpy as np

import command
import peers
import speed


def beside(scene):
    """{name: function of samples and seeds that returns peers.Shots} of what is installed."""
    out = {"Cycles 4.5": lambda samples, seeds: peers.cycles(scene, samples, seeds, step_rate=1.0)}
    if peers.newer_blender():
        out["Cycles 5.2"] = lambda samples, seeds: peers.cycles(scene, samples, seeds, python=peers.newer_blender())
    if peers.has_mitsuba():
        out["Mitsuba 3.9"] = lambda samples, seeds: peers.mitsuba(scene, samples, seeds)
    return out


def write(path, image):
    import OpenEXR

    pixels = np.ascontiguousarray(image, np.float32)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": pixels}).write(str(path))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--samples", type=int, nargs="+", default=[16, 64])
    parser.add_argument("--reference", type=int, default=768)
    parser.add_argument("--quick", action="store_true", help="fewer settings and seeds of ours")
    options = parser.parse_args()
    # Grids are written from another folder.
    options.folder = options.folder.resolve()
    others = options.folder / "others"
    others.mkdir(parents=True, exist_ok=True)
    # A grid that is written anew has another name within; a study goes on with the one that it was begun with.
    grid = others / "cumulus.vdb"
    before = grid.read_bytes() if grid.exists() else None
    scene = speed.scene(others, width=160, height=120)
    if before:
        grid.write_bytes(before)
    against = []
    for name, run in beside(scene).items():
        for samples in options.samples:
            path = others / f"{name.replace(' ', '_')}_{samples}.exr"
            seconds = path.with_suffix(".seconds")
            if not seconds.exists():
                shots = run(samples, [0, 1])
                write(path, shots.images[0])
                seconds.write_text(f"{statistics.median(shots.seconds):.2f}")
            against += ["--against", f"{path}:{seconds.read_text()}:{name}, {samples} samples"]
    quick = ["--quick"] if options.quick else []
    subprocess.run([str(command.binary()), "study", scene["vdb"], "-o", str(options.folder), "--reference", str(options.reference), *quick,
                    *map(str, peers.flags(scene)), *against], check=True, env=command.environment())


if __name__ == "__main__":
    main()
