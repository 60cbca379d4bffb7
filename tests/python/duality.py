"""The synthesised regions of one run twice: as a picture of ours, and as the VDB in Cycles; and how the two compare.

Our renderer has the regions as balls, in closed form. Cycles has the voxels: the layout's own camera, sun and surfaces, as
Blender imports them, and the grid with the printed density.
"""
import dataclasses
import math
import os
import pathlib

import numpy as np

import command
import flip
import gltf
import peers
import ztest
from blender import blender
from ztest import Picture

CYCLES = """
from layout import stage_layout
stage_layout(**given["stage"])
arrays["images"], out["seconds"] = shots(given["width"], given["height"], given["samples"], given["seeds"], given["bounces"],
                                         given["step_rate"])
"""
BLOCK = 8
# Seeds of Cycles that make one picture for FLIP: noise of few samples is skew, and screens show its mean too dark.
PAIR = 2
# Noise of one size but with other tails is seen as a difference: 1 to 5 % of the floor where pictures are equal otherwise.
SHAPE = 0.05


@dataclasses.dataclass
class Run:
    """What the command made of a layout, in one run: out.vdb, regions.glb and the first of the pictures."""
    scene: pathlib.Path
    folder: pathlib.Path
    report: object
    layers: dict            # of that picture
    seeds: np.ndarray       # pictures of the same regions, about as noisy as PAIR of Cycles

    @property
    def size(self):
        """(width, height)"""
        return self.layers["Combined"].shape[1::-1]

    @property
    def picture(self):
        return Picture.from_error(self.layers["Combined"], self.layers["StandardError"])

    def medium(self):
        """(albedo, g) of the regions, as regions.glb says. They share one: so must a material in Blender."""
        media = [node["extras"]["cloudvdb"] for node in gltf.read(self.folder / "regions.glb")["nodes"] if "extras" in node]
        media = np.array([(m["sigma_s"] / (m["sigma_s"] + m["sigma_a"]), m["g"]) for m in media if "sigma_s" in m])
        assert len(media) == self.report.regions_synthesised and np.ptp(media, axis=0).max() < 1e-6
        return media[0].tolist()

    def medium_light(self):
        return ztest.grey(self.layers["VolumeDir"] + self.layers["VolumeInd"])

    def edge(self):
        """Where a surface ends before the black sky: Cycles places a pixel's samples alike for every seed (ztest.rim)."""
        return ztest.rim(self.picture) & (ztest.grey(self.layers["Surface"]) > 0.0)


def synthesise(scene, folder, integrator, samples, noisy, size, options=(), photons="100k", seeds=4):
    """Regions, grid and picture in one run. Then its regions again for each of the `seeds`, with `noisy` samples."""
    folder = pathlib.Path(folder)
    seen = ("--integrator", integrator, "--size", "{}x{}".format(*size))
    report = command.make(scene, folder, "--photons", photons, "--seed", 1, "--spp", samples, *seen, *options,
                          outputs=("out.vdb", "regions.glb", "ours.exr"), timeout=1200)
    noisy_ones = []
    for seed in range(2, seeds + 2):
        target = folder / f"ours_{seed}.exr"
        command.succeed(folder / "regions.glb", "-o", target, "--density", "source", "--seed", seed, "--spp", noisy, *seen, timeout=1200)
        noisy_ones.append(peers.read_exr(target)["Combined"])
    return Run(pathlib.Path(scene), folder, report, peers.read_exr(folder / "ours.exr"), np.array(noisy_ones))


def cycles(run, samples, seeds=8, step_rate=1.0, denser=1.0, moved=0.0):
    """Cycles' pictures of the grid of `run`; or, on purpose, of one `denser`, or `moved` by voxels along x, y and z."""
    albedo, g = run.medium()
    stage = dict(path=str(run.scene), surfaces=run.report.became("surface"), vdb=str(run.folder / "out.vdb"),
                 voxel=run.report.voxel_size, density=run.report.density_scale * denser, albedo=albedo, g=g, moved=moved)
    out = blender(CYCLES, timeout=3000, stage=stage, width=run.size[0], height=run.size[1], samples=samples, seeds=list(range(seeds)),
                  bounces=peers.BOUNCES, step_rate=step_rate)
    return peers.Shots(out["arrays"]["images"], out["seconds"])


@dataclasses.dataclass
class Judged:
    """Two renders of the same regions, in figures."""
    verdict: ztest.Verdict
    block_rms: float        # of ours over theirs, less 1, in blocks that are not black
    block_noise: float      # what noise alone makes of that
    flip: float             # a picture of ours with one of theirs
    floors: tuple           # two of ours; two of theirs
    flip_error: float       # of flip less floor
    flip_allowed: float     # what the tolerance adds to the floor, and noise of another shape

    @property
    def floor(self):
        return sum(self.floors) / 2

    @property
    def seen(self):
        """Does FLIP see more than noise and the tolerance explain?"""
        return self.flip - self.floor > self.flip_allowed + 4.0 * self.flip_error

    @property
    def agree(self):
        return self.verdict.agree and not self.seen

    def __str__(self):
        return (f"{self.verdict}\n  blocks of {BLOCK}: RMS {self.block_rms:.2%}, {self.block_noise:.2%} by noise; FLIP {self.flip:.4f}, "
                f"floors {self.floors[0]:.4f} and {self.floors[1]:.4f}, difference {self.flip - self.floor:+.4f} +- {self.flip_error:.4f}, "
                f"{self.flip_allowed:.4f} allowed")


def judge(run, theirs, name, tolerance, samples):
    """`samples`: those of our picture over those of all of Cycles'. Seeds of Cycles that missed the rare bright paths are
    too low and too sure at once, so its variance is no less than ours for as many samples."""
    ours = run.picture
    their = Picture.from_seeds(theirs.images).no_better_than(ours, samples)
    verdict = ztest.compare(ours, their, name, tolerance, skip=run.edge())
    mean = (ours.mean + their.mean) / 2
    variance = sum(ztest.pooled(p.variance, mean) for p in (ours, their))
    a, b, noise = ztest.blocks(ours.mean, BLOCK), ztest.blocks(their.mean, BLOCK), ztest.blocks(variance, BLOCK) / BLOCK ** 2
    lit = b > 0.05 * b.max()
    # High, so that noise is seldom cut off.
    white = 1.5 * float(np.percentile(ours.mean, 99))
    pairs = theirs.images.reshape(-1, PAIR, *theirs.images.shape[1:]).mean(axis=1)
    show(ours.mean, their.mean, white / 1.5, name, run.folder)
    return Judged(verdict, math.sqrt(((a[lit] / b[lit] - 1) ** 2).mean()), math.sqrt((noise[lit] / b[lit] ** 2).mean()),
                  *eyed(*(images.mean(axis=-1) for images in (run.seeds, pairs)), white, tolerance * run.medium_light()))


def eyed(ours, theirs, white, more):
    """FLIP of ours with theirs, among ours and among theirs, the error of the first less the mean of the others (leaving out
    a picture at a time), and what is allowed between the two: what `more` light, or less, adds, and SHAPE of the floor."""
    cross, one, other = (flip.between(a, b, white) for a, b in ((ours, theirs), (ours, ours), (theirs, theirs)))

    def figures(rows, columns):
        floors = [matrix[np.ix_(kept, kept)].sum() / (len(kept) * (len(kept) - 1)) for matrix, kept in ((one, rows), (other, columns))]
        return float(cross[np.ix_(rows, columns)].mean()), tuple(map(float, floors))

    rows, columns = list(range(len(ours))), list(range(len(theirs)))

    def excess(rows, columns):
        value, floors = figures(rows, columns)
        return value - sum(floors) / 2

    left = ([excess([i for i in rows if i != k], columns) for k in rows], [excess(rows, [i for i in columns if i != k]) for k in columns])
    error = math.sqrt(sum((len(values) - 1) * np.var(values) for values in left))
    value, floors = figures(rows, columns)
    off = np.ones((len(ours),) * 2) - np.eye(len(ours))
    allowed = max(((flip.between(ours, ours + sign * more, white) - one) * off).sum() / off.sum() for sign in (-1, 1))
    return value, floors, error, float(allowed) + SHAPE * sum(floors) / 2


def show(ours, theirs, white, name, folder):
    """Ours, Cycles, their difference (red: ours is brighter; full at 20 % of white) and FLIP (white at 0.5), side by side.
    CLOUDVDB_PICTURES may name a folder for it."""
    target = pathlib.Path(os.environ.get("CLOUDVDB_PICTURES") or folder)
    target.mkdir(parents=True, exist_ok=True)
    bright = [np.clip(image / white, 0, 1)[..., None].repeat(3, axis=2) ** (1 / 2.2) for image in (ours, theirs)]
    seen = (flip.map_of(ours, theirs, white) / 0.5)[..., None].repeat(3, axis=2)
    ztest.png(target / f"{name}.png", ztest.enlarged(np.hstack([*bright, ztest.signed((ours - theirs) / (0.2 * white)), seen]), 1024))
