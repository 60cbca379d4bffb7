"""The duality, checked: the VDB of the synthesised regions in Cycles, and our own picture of the same regions.

One run writes both, so there is nothing between them but the voxels and the renderers. What they may differ by beyond
noise is measured: voxels smear a region's edge, so a ball catches some light that passed beside it. By our own integrator, the
grid of a ball of radius 6 m (sigma_t 1 per m, albedo 0.8) has 11, 4.6, 1.6 and 0.6 % more light from the medium than its
regions have, with voxels of 0.47, 0.23, 0.12 and 0.06 m. So these scenes have voxels of 0.12 m here, and 2 % are left to them.
Cycles marches, in steps of a voxel, at most half an optical depth where regions do not overlap. That adds nothing to be seen: on
`cumulus` 256 samples of Cycles are 0.3 +- 0.6 % below ours, blocks of 8 pixels 3.7 % off where noise makes 3.5 %.
"""
import dataclasses

import pytest

import duality

# The photon integrator is judged by the path tracer, in its own tests: it has a bias, and its noise is shared by pixels.
INTEGRATORS = ["path"]


@dataclasses.dataclass
class Effort:
    """Samples a pixel: of our picture; of each of ours as noisy as two of Cycles; of each of Cycles' eight."""
    ours: int
    noisy: int
    theirs: int
    size: tuple
    options: tuple = ()
    tolerance: float = 0.02

    def longer(self, times=8):
        return dataclasses.replace(self, ours=self.ours * times, noisy=self.noisy * times, theirs=self.theirs * times)


FINE = ("--voxel-size", "0.12")
SCENES = {
    "two_spheres": Effort(96, 20, 8, (64, 48)),
    "cumulus": Effort(80, 14, 8, (64, 48)),
    "hura2006_1": Effort(512, 16, 16, (48, 48), FINE),
    "hura2006_2": Effort(512, 16, 16, (48, 48), FINE),
    "hura2006_3": Effort(512, 16, 16, (48, 48), FINE),
    "hura2006_cumulus": Effort(128, 14, 8, (64, 48), FINE),
}


def made(scenes, name, folder, integrator, effort):
    return duality.synthesise(scenes / f"{name}.gltf", folder, integrator, effort.ours, effort.noisy, effort.size, effort.options)


def judged(run, name, effort, **how):
    theirs = duality.cycles(run, effort.theirs, **how)
    found = duality.judge(run, theirs, name, effort.tolerance, effort.ours / (effort.theirs * len(theirs.images)))
    print(found)
    return found


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", ["hura2006_3", "hura2006_cumulus"])
def test_the_grid_in_cycles_is_our_picture(cloudvdb, scenes, tmp_path, name, integrator):
    found = judged(made(scenes, name, tmp_path, integrator, SCENES[name]), f"{name}-{integrator}", SCENES[name])
    assert found.agree, found
    # Noise must not hide all.
    assert found.verdict.error < 0.03, found


@pytest.mark.long
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", SCENES)
def test_the_same_closely(cloudvdb, scenes, tmp_path, name, integrator):
    effort = SCENES[name].longer()
    found = judged(made(scenes, name, tmp_path, integrator, effort), f"{name}-{integrator}-closely", effort)
    assert found.agree, found
    assert found.verdict.error < 0.01, found


# Thin and even: little noise, and brightness nearly in proportion to density, so that small faults show. Where light is so, an edge
# that is smeared has no more of it: a quarter of the tolerance will do.
THIN = Effort(512, 60, 20, (48, 48), (*FINE, "--sigma-t", "0.1", "--albedo", "0.8", "-g", "0"), tolerance=0.005)
FAULTS = {"none": {}, "5 % denser": {"denser": 1.05}, "a voxel off": {"moved": 1.0}}


@pytest.fixture(scope="module")
def thin(cloudvdb, scenes, tmp_path_factory):
    return made(scenes, "hura2006_1", tmp_path_factory.mktemp("thin"), "path", THIN)


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_seen(thin, fault):
    found = judged(thin, f"thin, {fault}", THIN, step_rate=2.0, **FAULTS[fault])
    # By Z scores and by FLIP.
    wrong = fault != "none"
    assert (not found.verdict.agree, found.seen) == (wrong, wrong), found
