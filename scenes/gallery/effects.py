"""`effects.png`: each effect on and off, and the table of the README: `.venv/bin/python -I scenes/gallery/effects.py` (after `make build`).

Needs ImageMagick. A column an effect, in the table's order: above as the plan has it, below with `--effect NAME=off`. Seconds are of the renders alone, one after the
other in one run; the bound is the plan's, what was found is the difference of the two pictures' means over the mean.
"""
import json
import os
import pathlib
import subprocess
import tempfile

import numpy as np
import OpenEXR

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMMAND = os.environ.get("CLOUDVDB", str(ROOT / "target/release/cloudvdb"))
CUMULUS, BEAMS = "scenes/cumulus.gltf", "scenes/sunbeams.gltf"
NEAR = ["--camera", "-900,-1500,300", "--look-at", "0,0,420", "--fov", "46"]
#: Effect, scene, and the flags that make it matter.
LINES = [
    ("multiple_scattering", CUMULUS, NEAR),
    ("absorption", CUMULUS, [*NEAR, "--albedo", "0.98"]),
    ("anisotropy", CUMULUS, [*NEAR, "--sun", "0.6,1,-0.5"]),
    ("sky", CUMULUS, [*NEAR, "--sky", "clear"]),
    ("cloud_shadow", CUMULUS, ["--camera", "-900,-1500,900", "--look-at", "0,0,200", "--fov", "56"]),
    ("cloud_light", CUMULUS, ["--camera", "-300,-900,150", "--look-at", "0,0,60", "--fov", "60", "--sun", "0.1,0.1,-1"]),
    ("surface_bounce", CUMULUS, ["--camera", "-700,-1300,120", "--look-at", "0,0,380", "--fov", "46", "--sun", "0.1,0.1,-1"]),
    ("sun_disc", CUMULUS, ["--camera", "0,-900,2600", "--look-at", "0,100,0", "--fov", "40", "--sun-angle", "0.5"]),
    ("air", BEAMS, []),
    ("colour", CUMULUS, [*NEAR, "--irradiance", "3.4,2.6,1.6", "--sky", "0.1,0.16,0.32"]),
]


def picture(scene, flags, folder, name):
    """Renders; returns the PNG, the mean radiance, the seconds and the plan."""
    png, exr = folder / f"{name}.png", folder / f"{name}.exr"
    done = subprocess.run([COMMAND, scene, "-o", png, "-o", exr, "--json", "-q", "--density", "source", "--size", "200x150", "--spp", "16", "--photons", "500k",
                           *flags], cwd=ROOT, check=True, stdout=subprocess.PIPE)
    told = json.loads(done.stdout)
    with OpenEXR.File(str(exr), separate_channels=True) as file:
        light = np.stack([np.array(file.channels()[c].pixels, np.float64) for c in "RGB"])
    return png, light, next(s["seconds"] for s in told["stages"] if s["stage"] == "render"), {e["name"]: e for e in told["plan"]["effects"]}


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder, columns = pathlib.Path(folder), []
        print("| effect | seconds with it | without | bound by the plan | the pictures differ by |\n| --- | --- | --- | --- | --- |")
        for name, scene, flags in LINES:
            on = picture(scene, flags, folder, f"{name}_on")
            off = picture(scene, [*flags, "--effect", f"{name}=off"], folder, f"{name}_off")
            differ = np.abs(on[1] - off[1]).mean() / on[1].mean()
            bound = on[3][name]["bound"]
            print(f"| `{name}` | {on[2]:.1f} | {off[2]:.1f} | {'all' if bound >= 1 else f'{100 * bound:.1f} %'} | {100 * differ:.0f} % |", flush=True)
            column = folder / f"{name}.png"
            subprocess.run(["convert", str(on[0]), str(off[0]), "-append", "-bordercolor", "white", "-border", "2", str(column)], check=True)
            columns.append(str(column))
        rows = []
        for first in range(0, len(columns), 5):
            rows.append(str(folder / f"row{first}.png"))
            subprocess.run(["convert", *columns[first:first + 5], "+append", rows[-1]], check=True)
        subprocess.run(["convert", *rows, "-append", "-colors", "200", str(ROOT / "scenes/gallery/effects.png")], check=True)


main()
