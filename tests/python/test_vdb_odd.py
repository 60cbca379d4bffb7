"""Odd VDBs, as OpenVDB's own Python module writes them: read as they are meant, or refused in a sentence that names the fault."""
import subprocess

import pytest

import vdbinfo

START = r"""
import sys
import numpy as np, pyopenvdb as vdb

def grid(name="density", **kwargs):
    made = vdb.FloatGrid(**kwargs)
    made.name, made.gridClass = name, vdb.GridClass.FOG_VOLUME
    made.transform = vdb.createLinearTransform(0.1)
    return made

a = grid()
"""

READ = {
    # What is written into `a`, and the sum, the active voxels and a word of the notes that come out.
    "one voxel": ("a.fill((5, 6, 7), (5, 6, 7), 0.5)", 0.5, 1, ""),
    "far": ("a.fill((1 << 20, -(1 << 20), 3), ((1 << 20) + 8, -(1 << 20), 3), 2.0)", 18.0, 9, ""),
    "tiles only": ("a.fill((0, 0, 0), (127, 127, 127), 0.25)", 0.25 * 128 ** 3, 128 ** 3, ""),
    "negative": ("a.fill((0, 0, 0), (3, 3, 3), 1.0); a.fill((0, 0, 0), (0, 0, 1), -0.5)", 62.0, 62, "2 samples"),
    "inactive": ("a.fill((0, 0, 0), (3, 3, 3), 1.0); a.fill((0, 0, 2), (3, 3, 2), 7.0, False)", 48.0, 48, ""),
    # What is not active is no part of the cloud, also where it is not 0: renderers see what is active.
    "background": ("a = grid(background=3.0); a.fill((0, 0, 0), (3, 3, 3), 1.0)", 64.0, 64, "is 3 and not 0"),
    "half": ("a.saveFloatAsHalf = True; a.fill((0, 0, 0), (3, 3, 3), 0.1)", 64 * float("0.0999755859375"), 64, ""),
}

REFUSED = {
    "empty": ("", ["density", "empty"]),
    "zeros": ("a.fill((0, 0, 0), (3, 3, 3), 0.0)", ["density", "empty"]),
    "not a number": ("a.fill((0, 0, 0), (3, 3, 3), 1.0); a.fill((0, 0, 0), (0, 0, 2), float('nan'))", ["3 samples", "density", "finite"]),
    "infinite": ("a.fill((0, 0, 0), (3, 3, 3), 1.0); a.fill((0, 0, 0), (0, 0, 1), float('inf'))", ["2 samples", "density", "finite"]),
    "level set": ("a = vdb.createLevelSetSphere(radius=4, voxelSize=0.5); a.name = 'density'", ["density", "level set", "fog volume"]),
    "other names": ("a.name = 'smoke'; b = vdb.Vec3SGrid(); b.name = 'vel'; also = [b]", ["density", "smoke", "vel", "vec3s"]),
    "other type": ("a = vdb.Vec3SGrid(); a.name = 'density'; a.fill((0, 0, 0), (1, 1, 1), (1, 2, 3))", ["density", "vec3s", "float"]),
    "frustum": ("a.fill((0, 0, 0), (3, 3, 3), 1.0); a.transform = vdb.createFrustumTransform((0, 0, 0), (10, 10, 10), 0.5, 10)",
                ["density", "affine"]),
    "vast tile": ("a.fill((0, 0, 0), (8191, 4095, 4095), 2.0)", ["voxels", "tiles"]),
}


def make(path, script):
    script = START + "also = []\n" + script.replace("; ", "\n") + "\nvdb.write(sys.argv[1], [a, *also])\n"
    done = subprocess.run(["/usr/bin/python3", "-c", script, str(path)], capture_output=True, text=True, cwd="/")
    assert done.returncode == 0, done.stderr
    return path


@pytest.mark.parametrize("kind", READ)
def test_read(cloudvdb, tmp_path, kind):
    script, total, active, note = READ[kind]
    report = cloudvdb.make(make(tmp_path / "odd.vdb", script), tmp_path, "--sigma-t", "1")
    written = vdbinfo.read(tmp_path / "out.vdb")["grids"]["density"]
    assert (written["sum"], written["active"]) == (pytest.approx(total, rel=1e-6), active)
    assert written["background"] == 0 and any(note in text for text in [*report.notes, ""])
    assert kind == "background" or not any("background" in text for text in report.notes)


@pytest.mark.parametrize("kind", REFUSED)
def test_refused(cloudvdb, tmp_path, kind):
    script, says = REFUSED[kind]
    odd = make(tmp_path / "odd.vdb", script)
    cloudvdb.refuse(odd, "-o", tmp_path / "out.vdb", says=["odd.vdb", *says], folder=tmp_path)
