"""Builds the add-on's zips, and runs scripts in a Blender that has it installed."""
import atexit
import functools
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import pytest

from blender import CODA, INSIDE, blender
from command import ROOT, SCENES, binary

PACKAGE = ROOT / "blender_addon"
#: Blender's folders are the script's own, and the add-on comes by Blender's installer.
PRELUDE = f"""\
import json, os, sys
os.environ["BLENDER_USER_RESOURCES"] = os.path.join(os.getcwd(), "home")
sys.path.insert(0, {str(INSIDE)!r})
from kit import *
from addon_kit import *
given = json.load(open("given.json"))
out, arrays = {{}}, {{}}
addon = install(given["zip"])
preferences().binary = given["binary"]
"""
CHECKS = re.findall(r"^@check\ndef (\w+)", (INSIDE / "addon_checks.py").read_text(), re.MULTILINE)


@functools.cache
def zips(bundled=None):
    """The paths of the extension and of the legacy add-on, built and validated as `make addon` does; `bundled` is a command to bring along."""
    folder = tempfile.mkdtemp(prefix="cloudvdb-addon-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    options = ["--binary", bundled] if bundled else []
    done = subprocess.run([sys.executable, "-I", PACKAGE / "build.py", "--output", folder, *options], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout
    return [pathlib.Path(line) for line in done.stdout.splitlines()]


def with_addon(script, python=None, bundled=None, command=None, **given):
    """Runs `script` where the add-on is installed and knows the command under test."""
    return blender(script, python=python, prelude=PRELUDE, zip=str(zips(bundled)[0]), binary=str(binary()) if command is None else command,
                   scenes=str(SCENES), **given)


def bpy52():
    """The Python with bpy 5.2 that CLOUDVDB_BPY52 names; else the test is skipped."""
    named = os.environ.get("CLOUDVDB_BPY52")
    if not named:
        pytest.skip("CLOUDVDB_BPY52 names no Python with bpy 5.2")
    return named




def in_distribution(script, folder, **given):
    """Runs `script` in the distribution's own Blender, in the background, with the add-on; what it puts into `out`. Skips where there is none."""
    if not shutil.which("blender"):
        pytest.skip("no blender here (apt-get install blender)")
    version = subprocess.run(["blender", "--version"], stdout=subprocess.PIPE, text=True).stdout.split()[1]
    legacy = tuple(map(int, version.split(".")[:2])) < (4, 2)
    (folder / "given.json").write_text(json.dumps({**given, "zip": str(zips()[legacy]), "binary": str(binary()), "scenes": str(SCENES)}))
    (folder / "script.py").write_text(f"import os\nos.chdir({str(folder)!r})\n" + PRELUDE + script + CODA)
    environment = dict(os.environ, BLENDER_USER_RESOURCES=str(folder / "home"))
    done = subprocess.run(["blender", "-b", "--factory-startup", "-P", str(folder / "script.py")], env=environment, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)
    assert (folder / "out.json").exists(), done.stdout[-4000:]
    return json.loads((folder / "out.json").read_text())
