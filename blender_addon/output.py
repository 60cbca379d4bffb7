# SPDX-License-Identifier: GPL-3.0-or-later
"""Where files go: a folder, free names, and a place beside the target where a run that is stopped leaves nothing."""
import os
import re
import shutil
import tempfile

import bpy

from .errors import CloudError


def folder_of(settings):
    """The folder for VDBs, and a sentence where it is a temporary one. Raises `CloudError`."""
    asked = settings.folder.strip() or "//clouds/"
    if asked.startswith("//") and not bpy.data.filepath:
        return os.path.join(bpy.app.tempdir, "clouds"), (
            "The .blend file is not saved: the cloud lies in a temporary folder that Blender empties when it closes. "
            "Save, and press the button again")
    return os.path.abspath(bpy.path.abspath(asked)), ""


def clean(name):
    """A file's name that all systems take; letters of all scripts, and spaces, stay."""
    return re.sub(r'[\x00-\x1f<>:"/\\|?*]', "_", name).strip(" .") or "Cloud"


class Workshop:
    """A hidden folder in the target's: the command writes there, `deliver` renames. `clear` takes it away, and folders made for it."""

    def __init__(self, folder):
        self.folder, self.made = folder, []
        try:
            missing = folder
            while not os.path.isdir(missing):
                self.made.append(missing)
                missing = os.path.dirname(missing)
            os.makedirs(folder, exist_ok=True)
            self.path = tempfile.mkdtemp(prefix=".cloudvdb-", dir=folder)
        except OSError as error:
            self._unmake()
            raise CloudError(f"Nothing can be written into {folder} ({error.strerror}): choose another folder under Output in the panel Cloud") from error

    def file(self, name):
        """The path of a file in the workshop."""
        return os.path.join(self.path, name)

    def deliver(self, name, path):
        """Moves a finished file to its place, in one step."""
        try:
            os.replace(self.file(name), path)
        except OSError as error:
            raise CloudError(f"{path} cannot be written ({error.strerror}): choose another folder under Output in the panel Cloud") from error
        self.made.clear()

    def clear(self):
        """Removes the workshop and all in it."""
        shutil.rmtree(self.path, ignore_errors=True)
        self._unmake()

    def _unmake(self):
        for folder in self.made:
            try:
                os.rmdir(folder)
            except OSError:
                break
