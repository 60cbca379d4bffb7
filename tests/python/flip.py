"""FLIP (Andersson et al. 2020): how much of a difference between two pictures the eye sees, by its authors' own package."""
import flip_evaluator
import numpy as np


def shown(image, white):
    """A picture of radiance as a screen shows it, linear: 1 is `white` and what is brighter."""
    return np.clip(image / white, 0.0, 1.0)[..., None].repeat(3, axis=2).astype(np.float32)


def map_of(reference, test, white):
    """LDR-FLIP of each pixel, at the package's own distance (67 pixels a degree): 0 is no difference, 1 the largest."""
    found, _, _ = flip_evaluator.evaluate(shown(reference, white), shown(test, white), "LDR", inputsRGB=False, applyMagma=False)
    return np.asarray(found, np.float64).reshape(reference.shape)


def between(ones, others, white):
    """The mean FLIP of every picture of the one kind with every one of the other: a matrix."""
    return np.array([[map_of(a, b, white).mean() for b in others] for a in ones])
