"""What pictures say of their own errors, against the path tracer: coverage of the stated intervals, and where `--error` and `--time` land.

    python tests/python/honest.py coverage [--seeds 20] [--integrators path photon] [--scenes 0 1 2]
    python tests/python/honest.py landing [--errors 5 2] [--times 5 15]

Coverage: the share of lit pixels that are not known exactly, of all seeds together, whose 95 % interval holds the truth; the truth's own error
is counted. Landing: the error that was found over the one asked for, the seconds that were foretold over those it took, the seconds it took over
those it was given.
Truths are two pictures of the path tracer each; an error's square is the mean of (I - A)(I - B), which is free of their noise. With `--keep
FOLDER` they are made once.
"""
import argparse
import json
import math
import pathlib
import tempfile

import numpy as np

import command
import peers

SIDE, FRONT, AGAINST = (0.8, 0.4, -0.6), (0.1, 0.9, -0.4), (-0.1, -0.9, -0.35)


def heap(count, seed, sigma, **medium):
    rng = np.random.default_rng(seed)
    return [peers.ball(tuple(map(float, rng.normal(0, 0.45, 3))), float(rng.uniform(0.3, 0.7)), sigma, **medium) for _ in range(count)]


def one(sigma, **medium):
    return [peers.ball((0.0, 0.0, 0.0), 1.0, sigma, **medium)]


def lit(direction):
    return {"direction": direction, "irradiance": 3.0, "angle": 0.00918}


def scenes(width, height):
    """Ten: thin and thick, from the side, the front and against the sun, g from -0.4 to 0.95, albedo 0.9 to 1, a ground, a sky, haze."""
    say = {
        "thin, g 0": dict(sun=lit(SIDE), balls=one(0.25, g=0.0)),
        "depth 4, g -0.4, front": dict(sun=lit(FRONT), balls=one(2.0, g=-0.4)),
        "depth 16, g 0.85": dict(sun=lit(SIDE), balls=one(8.0)),
        "depth 16, g 0.85, front": dict(sun=lit(FRONT), balls=one(8.0)),
        "depth 64, g 0.85": dict(sun=lit(SIDE), balls=one(32.0, albedo=1.0)),
        "depth 16, g 0.95, against": dict(sun=lit(AGAINST), balls=one(8.0, g=0.95)),
        "albedo 0.9": dict(sun=lit(SIDE), balls=one(8.0, albedo=0.9, g=0.5)),
        "thirty balls": dict(sun=lit(SIDE), balls=heap(30, 3, 6.0)),
        "twelve under a sky": dict(sun=lit(SIDE), balls=heap(12, 5, 5.0, g=0.6), sky=0.2),
        "twelve in haze": dict(sun=lit(SIDE), balls=heap(12, 7, 5.0, g=0.6),
                               haze={"sigma": 0.05, "albedo": 0.95, "g": 0.5, "base": -1.5, "top": 1.5, "half_size": 50.0}),
    }
    return {name: peers.described(width, height, **what) for name, what in say.items()}


def picture(scene, folder, *arguments):
    """A picture, grey, its standard errors, and the report."""
    target, report = folder / "picture.exr", folder / "report.json"
    layout = peers.layout(scene, folder / "scene.glb")
    ran = command.succeed(layout, "-o", target, "-o", report, "--overwrite", "--density", "source", "-q", *map(str, arguments),
                          *peers.flags(scene), timeout=3000)
    layers = peers.read_exr(target)
    grey = np.array([0.2126, 0.7152, 0.0722])
    said = json.loads(report.read_text())
    said["wall"] = ran.seconds
    # Errors of red, green and blue that ride together add up as they are.
    return layers["Combined"].astype(float) @ grey, layers["StandardError"].astype(float) @ grey, said


class Truth:
    def __init__(self, scene, folder, samples, kept=None):
        """Of two pictures, from the file `kept` where it is there."""
        if kept and kept.exists():
            self.a, e, self.b, f = (np.load(kept)[key] for key in "aebf")
        else:
            (self.a, e, _), (self.b, f, _) = (picture(scene, folder, "--integrator", "path", "--spp", samples, "--seed", 2**40 + i)
                                              for i in (0, 1))
            if kept:
                kept.parent.mkdir(parents=True, exist_ok=True)
                np.savez(kept, a=self.a, e=e, b=self.b, f=f)
        self.mean, self.error = (self.a + self.b) / 2, np.hypot(e, f) / 2
        self.lit = self.mean > 0.02 * self.mean.max()
        self.level = self.mean[self.lit].mean()

    def off(self, image):
        """The relative error of a pixel, without the truth's noise; and how well it is known, by the pixels' scatter."""
        squares = ((image - self.a) * (image - self.b))[self.lit] / self.level ** 2
        found = math.sqrt(max(squares.mean(), 0.0))
        return found, squares.std() / math.sqrt(squares.size) / max(2 * found, 1e-9)


WORK = {"path": ("--integrator", "path", "--spp", 256)}
WORK |= {name: ("--integrator", name, "--photons", "200k", "--spp", 16) for name in ("grid", "photon")}
WORK |= {"beam": (*WORK["photon"], "--gather", "beam")}


def chosen(width, height, options, folder):
    """Names, scenes and their truths."""
    for number, (name, scene) in enumerate(scenes(width, height).items()):
        if not options.scenes or number in options.scenes:
            yield name, scene, Truth(scene, folder, options.reference, options.keep and options.keep / f"{number}_{width}_{options.reference}.npz")


def coverage(options, folder):
    print(f"{'':28}" + "".join(f"{name:>10}{'off':>8}{'stated':>8}" for name in options.integrators))
    for name, scene, truth in chosen(48, 36, options, folder):
        line = f"{name:28}"
        for integrator in options.integrators:
            if integrator in ("photon", "beam") and (scene["sky"] or scene.get("haze")):
                line += f"{'-':>10}{'':16}"
                continue
            held, off, stated = [], [], []
            for seed in range(options.seeds):
                image, error, said = picture(scene, folder, *WORK[integrator], "--seed", seed)
                quantile = said["render"]["interval_95"]
                within = np.abs(image - truth.mean) <= np.hypot(quantile * error, 1.96 * truth.error)
                # What is known exactly, as a sky before which nothing is, has no interval.
                held.append(within[truth.lit & (error > 0)].mean())
                off.append(truth.off(image)[0] ** 2)
                stated.append(said["render"]["relative_error"] ** 2)
            line += f"{np.mean(held):10.1%}{np.mean(off) ** 0.5:8.1%}{np.mean(stated) ** 0.5:8.1%}"
        print(line, flush=True)


def landing(options, folder):
    print(f"{'':28}{'asked':>8}{'found/asked':>20}{'stated':>8}{'seconds':>9}{'foretold':>10}")
    for name, scene, truth in chosen(96, 72, options, folder):
        goals = [("--error", f"{e:g}%") for e in options.errors] + [("--time", f"{t:g}s") for t in options.times]
        for flag, goal in goals:
            image, _, said = picture(scene, folder, flag, goal, "--seed", 7)
            render, (found, doubt) = said["render"], truth.off(image)
            expected = render.get("expected") or {}
            asked = float(goal[:-1])
            share = f"{100 * found / asked:12.2f} +-{100 * doubt / asked:5.2f}" if flag == "--error" else f"{said['wall'] / asked:18.2f} t"
            foretold = f"{expected['seconds'] / render['seconds']:10.2f}" if expected else f"{'-':>10}"
            print(f"{name:28}{goal:>8}{share}{render['relative_error']:8.1%}{render['seconds']:9.1f}{foretold}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("coverage", "landing"))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--integrators", nargs="+", choices=tuple(WORK), default=["path", "grid", "photon"])
    parser.add_argument("--scenes", type=int, nargs="*", default=[], help="by number, from 0; all")
    parser.add_argument("--reference", type=int, default=2048, help="samples a pixel of each of the two")
    parser.add_argument("--keep", type=pathlib.Path, help="a folder for truths")
    parser.add_argument("--errors", type=float, nargs="*", default=[5.0, 2.0], help="per cent")
    parser.add_argument("--times", type=float, nargs="*", default=[4.0])
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        {"coverage": coverage, "landing": landing}[options.what](options, pathlib.Path(name))


if __name__ == "__main__":
    main()
