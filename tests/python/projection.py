"""The optical depth of balls along parallel rays, in closed form, and how a picture of it is judged."""
import dataclasses

import numpy as np


@dataclasses.dataclass
class Ball:
    centre: tuple
    radius: float
    sigma: float

    @property
    def mass(self):
        """sigma_t times volume, m^2."""
        return self.sigma * 4.0 / 3.0 * np.pi * self.radius ** 3


def mass(balls):
    return sum(b.mass for b in balls)


def bounds(balls):
    low = np.min([np.array(b.centre) - b.radius for b in balls], axis=0)
    high = np.max([np.array(b.centre) + b.radius for b in balls], axis=0)
    return low, high


def optical_depth(balls, centre, right, up, width, pixels, fine=4):
    """Depths at fine x fine points a pixel: an array of (pixels * fine) squared, row 0 at the top."""
    n = pixels * fine
    u = ((np.arange(n) + 0.5) / n - 0.5) * width
    depth = np.zeros((n, n))
    right, up = np.array(right), np.array(up)
    for ball in balls:
        away = np.array(ball.centre) - np.array(centre)
        x, y = away @ right, away @ up
        d2 = (u[None, :] - x) ** 2 + (-u[:, None] - y) ** 2
        depth += ball.sigma * 2.0 * np.sqrt(np.maximum(0.0, ball.radius ** 2 - d2))
    return depth


def picture(depth, pixels):
    """What a camera with a box filter sees of a white sky through `depth`."""
    fine = depth.shape[0] // pixels
    return np.exp(-depth).reshape(pixels, fine, pixels, fine).mean(axis=(1, 3))


@dataclasses.dataclass
class Verdict:
    """A picture against the closed form. Lengths in the unit of `width`."""
    mass: float         # integral of -ln T over the picture, over the expected one
    shift: np.ndarray   # of the centroid along the world's axes
    overlap: float      # of the silhouettes: intersection over union
    error: float        # root mean square difference of depths over the root mean square depth


def judge(image, balls, centre, right, up, width):
    pixels = image.shape[0]
    truth = -np.log(picture(optical_depth(balls, centre, right, up, width, pixels), pixels))
    seen = -np.log(np.clip(image, 1e-12, None))
    at = ((np.arange(pixels) + 0.5) / pixels - 0.5) * width

    def centroid(depth):
        return (np.array(right) * (depth.sum(axis=0) @ at) - np.array(up) * (depth.sum(axis=1) @ at)) / depth.sum()

    edge = 0.1 * truth.max()
    a, b = seen > edge, truth > edge
    return Verdict(mass=seen.sum() / truth.sum(), shift=centroid(seen) - centroid(truth),
                   overlap=(a & b).sum() / max(1, (a | b).sum()),
                   error=float(np.sqrt(((seen - truth) ** 2).mean() / (truth ** 2).mean())))
