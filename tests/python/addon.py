"""Builds the add-on's zips, and runs scripts in a Blender that has it installed."""
import functools
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import pytest

from blender import INSIDE, blender
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


