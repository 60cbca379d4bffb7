"""The cloud of the comparisons: 21 of Wyvill's metaballs (Wyvill, McPheeters, Wyvill 1986), sampled on a grid.

Its constants are those of the published reference picture (cumulus128_reference.json): they must not move.
"""
import numpy as np

LOW, HIGH = np.array([-2.0, -1.6, -1.0]), np.array([2.0, 1.6, 1.6])


def elements(seed=7, count=21):
    """Centres and radii: an oval 2.4 by 1.6 wide, higher in the middle."""
    rng = np.random.default_rng(seed)
    centres, radii = np.empty((count, 3)), np.empty(count)
    for i in range(count):
        angle, out = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 1.0) ** 0.7
        centres[i] = 1.2 * out * np.cos(angle), 0.8 * out * np.sin(angle), rng.uniform(-0.2, 0.7) * (1.0 - 0.6 * out)
        radii[i] = rng.uniform(0.3, 0.62)
    return centres, radii


def values(cells):
    """(density in 0 to 1 as x, y, z; size of a voxel; centre of the first) with `cells` along x, the longest side."""
    voxel = float((HIGH - LOW).max() / cells)
    counts = np.ceil((HIGH - LOW) / voxel).astype(int)
    # The positions are 32-bit numbers, as the reference's were.
    x, y, z = np.meshgrid(*(np.float32(LOW[k] + (np.arange(counts[k]) + 0.5) * voxel) for k in range(3)), indexing="ij")
    field = np.zeros(counts, np.float32)
    for (cx, cy, cz), r in zip(*elements()):
        d2 = (x - np.float32(cx)) ** 2 + (y - np.float32(cy)) ** 2 + (z - np.float32(cz)) ** 2
        field += 2 * np.clip(1 - d2 / (r * r), 0, None) ** 3
    density = np.where(field > 0.35, np.minimum(1.0, (field - 0.35) * 4.0), 0.0).astype(np.float32)
    return density, voxel, LOW + 0.5 * voxel
