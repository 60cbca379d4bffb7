# SPDX-License-Identifier: GPL-3.0-or-later
"""The names of a cloud's files. Each press writes a new take, "Cloud.vdb", "Cloud 2.vdb", and so on: Blender keeps showing the old grids
of a name that it has read before, and undo finds the earlier take again. Takes that no saved .blend shows are removed, but for the
last ones."""
import glob
import os
import re

import bpy
from bpy.app.handlers import persistent

from . import output

#: How many presses can be undone with the cloud of then.
UNDONE = 3
#: Stems written since Blender started, in their order, and those that a .blend on disk shows.
_written, _saved = [], set()


def stem_of(path):
    """A take's path without the ending and a sequence's number."""
    return re.sub(r"(\.\d{4,})?\.vdb$", "", os.path.abspath(bpy.path.abspath(path)))


def files(stem):
    """A take's files: a grid, or a sequence and the list of its frames."""
    return [path for path in glob.glob(glob.escape(stem) + ".*") if re.fullmatch(r"(\.\d{4,})?\.vdb|\.frames\.json", path[len(stem):])]


def next_stem(folder, name, cloud=None):
    """The stem of a cloud's next take: a name that no file has."""
    base, number = os.path.join(folder, output.clean(name)), 1
    if cloud is not None:
        last = stem_of(cloud.data.filepath)
        match = re.fullmatch(r"(.*?)(?: (\d+))?", os.path.basename(last))
        if os.path.dirname(last) == folder:
            base, number = os.path.join(folder, match.group(1)), int(match.group(2) or 1) + 1
    while True:
        stem = base if number == 1 else f"{base} {number}"
        if stem not in _written and not files(stem):
            return stem
        number += 1


def _shown():
    return {stem_of(volume.filepath) for volume in bpy.data.volumes if volume.filepath}


def wrote(stem):
    """A take is on disk and shown: older ones that nothing needs go."""
    if stem in _written:
        _written.remove(stem)
    _written.append(stem)
    spare = [old for old in _written if old not in _saved and old not in _shown()]
    for old in spare[:-UNDONE]:
        _written.remove(old)
        for path in files(old):
            try:
                os.remove(path)
            except OSError:
                pass  # Somebody reads it: it stays.


@persistent
def remember(*_):
    """A .blend is on disk: the takes that it shows stay for good."""
    _saved.update(_shown())


def register():
    bpy.app.handlers.save_post.append(remember)
    bpy.app.handlers.load_post.append(remember)


def unregister():
    bpy.app.handlers.load_post.remove(remember)
    bpy.app.handlers.save_post.remove(remember)
