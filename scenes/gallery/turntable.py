"""Takes `turntable.png` and its figures: 36 frames around a cumulus in Cycles, its light baked once, against Cycles with its denoiser.

    .venv/bin/python scenes/gallery/turntable.py scenes/gallery/turntable.png [--samples 4] [--reference-samples 512]

The cloud is that of the cross-checks (128 cells, g 0.85, optical depth 60), 192 x 144. At four views each picture's error of a pixel is taken
against two of the path tracer (`bakes.off`). The denoiser gets as many samples as it needs, doubled from `--samples` on, for a mean error
there that is at most that of the bake; all frames take it nine times as long as those four.
Seconds are those of `bpy.ops.render.render` with Persistent Data, files and all. Blender is 5.2 where CLOUDVDB_BPY52 names its Python, else
4.5. The rows of the picture: path tracer, baked, denoised.
"""
import argparse
import math
import pathlib
import statistics
import struct
import sys
import tempfile
import zlib

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests" / "python"))

import command
import peers
import speed
from bake_error import grey, truths
from bakes import off, shown
from blender import blender

FRAMES, VIEWS = 36, (2, 11, 20, 29)
LIVE = """
stage(given["scene"])
size = given["scene"]["width"], given["scene"]["height"]
scene = settings(*size, given["samples"], given["bounces"], 1.0)
scene.render.use_persistent_data = True
scene.cycles.use_denoising, scene.cycles.denoiser = True, "OPENIMAGEDENOISE"
images, out["seconds"] = [], []
for number, place in enumerate(given["places"]):
    scene.cycles.seed = number
    scene.camera.location = place
    scene.camera.rotation_euler = (Vector(given["scene"]["camera"]["look_at"]) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    begin = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    out["seconds"].append(time.perf_counter() - begin)
    image = bpy.data.images.load(scene.render.filepath)
    images.append(np.array(image.pixels[:], np.float32).reshape(size[1], size[0], 4)[::-1, :, :3])
    bpy.data.images.remove(image)
arrays["images"] = np.array(images)
"""


def live(scene, samples, places, python):
    return blender(LIVE, python=python, timeout=3000, scene=peers.plain(scene), samples=samples, bounces=peers.BOUNCES, places=places)


def errors(images, truth):
    """Relative RMSE of a pixel at each view."""
    return [off(image, pair)[0] for image, pair in zip(grey(images), truth)]


def told(name, seconds, found):
    print(f"{name:34} {seconds:8.1f} s   {statistics.mean(found):.1%} ({', '.join(f'{e:.1%}' for e in found)})", flush=True)


def png(path, rows):
    """Rows of linear pictures, as an 8-bit sRGB PNG."""
    sheet = np.concatenate([np.concatenate([np.stack([image] * 3, axis=2) if image.ndim == 2 else image for image in row], axis=1) for row in rows])
    level = np.clip(sheet / np.quantile(sheet, 0.995), 0.0, 1.0)
    level = np.where(level < 0.0031308, 12.92 * level, 1.055 * level ** (1 / 2.4) - 0.055)
    pixels = (255 * level + 0.5).astype(np.uint8)
    lines = b"".join(b"\0" + line.tobytes() for line in pixels)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines, 9)) + chunk(b"IEND", b""))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", type=pathlib.Path)
    parser.add_argument("--photons", default="1M")
    parser.add_argument("--samples", type=int, default=4)
    parser.add_argument("--reference-samples", type=int, default=512)
    asked = parser.parse_args()
    python = peers.newer_blender()
    places = [(5.2 * math.sin(angle), -5.2 * math.cos(angle), 0.2) for angle in (2 * math.pi * i / FRAMES for i in range(FRAMES))]
    views = [places[i] for i in VIEWS]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scene = speed.scene(folder)
        truth = [truths({**scene, "camera": {**scene["camera"], "position": place}}, folder, asked.reference_samples) for place in views]
        script = folder / "cloud.blend.py"
        ran = command.succeed(scene["vdb"], "-o", folder / "cloud.vdb", "-o", script, "-q", "--bake", "sh2", "--photons", asked.photons, "--no-check",
                              *peers.flags(scene), timeout=600)
        print(f"{'':34} {'seconds':>10}   error of a pixel at four views")
        print(f"{'bake sh2, ' + asked.photons + ' photons':34} {ran.seconds:8.1f} s", flush=True)
        turned = shown(script, places=places, python=python, persistent=True)
        baked = [turned["arrays"]["images"][i] for i in VIEWS]
        goal = errors(baked, truth)
        told(f"{FRAMES} frames baked, 4 samples", sum(turned["seconds"]), goal)
        samples, found = asked.samples // 2, [math.inf]
        while statistics.mean(found) > statistics.mean(goal):
            samples *= 2
            some = live(scene, samples, views, python)
            found = errors(some["arrays"]["images"], truth)
            told(f"4 frames denoised, {samples} samples", sum(some["seconds"]), found)
        total, frames = sum(some["seconds"]) * FRAMES / len(VIEWS), sum(turned["seconds"])
        print(f"{FRAMES} frames denoised: {total:.0f} s, {total / (ran.seconds + frames):.1f} times bake and frames, {total / frames:.1f} times the frames")
        png(asked.target, [[(a + b) / 2 for a, b in truth], baked, some["arrays"]["images"]])


if __name__ == "__main__":
    main()
