"""The duality, checked: the VDB of the synthesised regions in Cycles, and our own picture of the same regions.

One run writes both, so there is nothing between them but the voxels and the renderers. What they may differ by beyond
noise, measured:

* Voxels smear a region's edge over one of them, and fog around a ball catches light that passed before. Rendered by our own
  integrator, the grid of `hura2006_1` has 11, 4.6, 1.6 and 0.6 % more light from the medium than the balls at 4, 2, 1 and
  1/2 of the default voxel. 2 % cover that, and 1 % does at half the voxel.
* Cycles 4.5 marches: SCENES says what that takes where a voxel is not thin.
"""
import dataclasses

import pytest

import duality

# `photon` joins when there is one.
INTEGRATORS = ["path"]


@dataclasses.dataclass
class Effort:
    """Samples a pixel: of our picture; of each of ours as noisy as one of Cycles; of each of Cycles' eight."""
    ours: int
    noisy: int
    theirs: int
    tolerance: float = 0.02


SCENES = {
    "two_spheres": Effort(192, 16, 16),
    "cumulus": Effort(128, 8, 12),
    "hura2006_1": Effort(1024, 8, 32),
    "hura2006_2": Effort(1024, 8, 32),
    "hura2006_3": Effort(1024, 8, 32),
    "hura2006_cumulus": Effort(512, 8, 16),
}


def made(scenes, name, folder, integrator, effort, options=()):
    return duality.synthesise(scenes / f"{name}.gltf", folder, integrator, effort.ours, effort.noisy, options=options)


def judged(run, name, effort, **faults):
    theirs = duality.cycles(run, effort.theirs, **faults)
    found = duality.judge(run, theirs, name, effort.tolerance, effort.ours / (effort.theirs * len(theirs.images)))
    print(found)
    return found


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", SCENES)
def test_the_grid_in_cycles_is_our_picture(cloudvdb, scenes, tmp_path, name, integrator):
    found = judged(made(scenes, name, tmp_path, integrator, SCENES[name]), name, SCENES[name])
    assert found.agree, found
    # Noise must not hide all.
    assert found.verdict.error < 0.02, found
