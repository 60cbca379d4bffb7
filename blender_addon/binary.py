# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the command `cloudvdb` is, and whether it is the one that this add-on speaks with."""
import os
import re
import shutil
import stat
import subprocess
import sys

import bpy

from .errors import CloudError

#: The command's versions that understand this add-on: major and minor.
SPEAKS = (0, 1)
NAME = "cloudvdb.exe" if sys.platform == "win32" else "cloudvdb"
HERE = os.path.dirname(os.path.abspath(__file__))
GET_IT = ("Build it in cloudvdb's folder with `make build`, then name target/release/cloudvdb in Edit > Preferences > Add-ons > cloudvdb, "
          "put it on the PATH (`cargo install --path .`), or build a zip that brings it along (`make addon`)")
#: Versions by (path, time of change, size): asked once.
_known = {}


def locate(preferences):
    """The path of the command: that of the preferences, else beside the add-on, else on the PATH. Raises `CloudError`."""
    named = bpy.path.abspath(preferences.binary) if preferences and preferences.binary else ""
    if named:
        if os.path.isdir(named):
            named = os.path.join(named, NAME)
        if not os.path.isfile(named):
            raise CloudError(f"The command cloudvdb is not at {named}, where the add-on's preferences say. {GET_IT}")
        return named
    bundled = os.path.join(HERE, "bin", NAME)
    if os.path.isfile(bundled):
        return runnable(bundled)
    found = shutil.which("cloudvdb")
    if found is None:
        raise CloudError(f"The command cloudvdb was not found. {GET_IT}")
    return found


def runnable(bundled):
    """A copy of the bundled command in the user's folder that may be run: Blender's installer drops the run bit, and the add-on's own
    folder may be read-only."""
    if os.access(bundled, os.X_OK):
        return bundled
    folder = user_folder()
    copy = os.path.join(folder, NAME)
    ours, theirs = os.stat(bundled), os.stat(copy) if os.path.isfile(copy) else None
    if theirs is None or (theirs.st_size, int(theirs.st_mtime)) != (ours.st_size, int(ours.st_mtime)) or not os.access(copy, os.X_OK):
        fresh = f"{copy}.{os.getpid()}"
        try:
            shutil.copy2(bundled, fresh)
            os.chmod(fresh, os.stat(fresh).st_mode | stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
            os.replace(fresh, copy)
        except OSError as error:
            raise CloudError(f"The bundled command could not be copied to {copy} ({error.strerror}). Name one in the preferences") from error
    return copy


def user_folder():
    """The folder of the user's that an add-on may write into."""
    if __package__.startswith("bl_ext.") and hasattr(bpy.utils, "extension_path_user"):
        return bpy.utils.extension_path_user(__package__, path="bin", create=True)
    return bpy.utils.user_resource("DATAFILES", path="cloudvdb", create=True)


def version(path):
    """The version of the command at `path`, as a string. Raises `CloudError` where it cannot be run or is something else."""
    try:
        status = os.stat(path)
    except OSError as error:
        raise CloudError(f"{path} cannot be read ({error.strerror}). {GET_IT}") from error
    key = (path, status.st_mtime_ns, status.st_size)
    if key not in _known:
        _known[key] = _ask(path)
    return _known[key]


def _ask(path):
    try:
        done = subprocess.run([path, "--version"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=10,
                              creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0))
    except (OSError, subprocess.TimeoutExpired) as error:
        reason = getattr(error, "strerror", None) or "it does not answer"
        raise CloudError(f"{path} does not run ({reason}). {GET_IT}") from error
    text = done.stdout.decode("utf-8", "replace").strip()
    match = re.fullmatch(r"cloudvdb (\d+\.\d+\.\d+\S*)", text)
    if done.returncode or not match:
        raise CloudError(f"{path} does not run as cloudvdb: {text[-200:] or f'exit code {done.returncode}'}. {GET_IT}")
    return match.group(1)


def check(preferences):
    """The path of a command that this add-on speaks with. Raises `CloudError`."""
    path = locate(preferences)
    found = version(path)
    if tuple(int(part) for part in found.split(".")[:2]) != SPEAKS:
        wanted = ".".join(map(str, SPEAKS))
        raise CloudError(f"{path} is cloudvdb {found}, and this add-on speaks with {wanted}: install the add-on and the command of one version")
    return path
