"""Small layouts that several tests share, and the arguments that make a run of them short."""
import math

import gltf
from projection import Ball

# Photons for tests that ask whether things fit together, not how accurate they are.
FAST = ("--photons", "20000", "--estimate", "100", "--seed", "7")

BALLS = [Ball((0.31, -0.2, 1.1), 0.8, 4.0), Ball((0.9, 0.35, 1.4), 0.6, 6.0), Ball((-0.2, 0.2, 0.6), 0.5, 8.0)]


def three_balls(path, albedo=0.95, g=0.6):
    """Three overlapping balls of a metre, with different media, 8 to 10 optical depths thick; a sun."""
    return gltf.scene(path, *(gltf.ball(f"Cloud.{i}", b.centre, b.radius, sigma_s=b.sigma * albedo,
                                        sigma_a=b.sigma * (1 - albedo), g=g) for i, b in enumerate(BALLS)))


def to_balls(imported):
    """What Blender found in a file (kit.import_balls), as balls with their extinction."""
    def sigma(medium):
        return grey(medium["sigma_s"]) + grey(medium["sigma_a"])

    return [Ball(tuple(b["centre"]), b["radius"], sigma(b["cloudvdb"])) for b in imported]


def grey(value):
    """A coefficient as one number: RGB by its luminance."""
    if isinstance(value, (int, float)):
        return float(value)
    return math.fsum(w * v for w, v in zip((0.2126, 0.7152, 0.0722), value))
