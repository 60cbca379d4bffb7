# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: where the command is."""
import bpy
from bpy.props import StringProperty

from . import binary
from .errors import CloudError
from .settings import RELATIVE


class CloudPreferences(bpy.types.AddonPreferences):
    """Shown in Edit > Preferences > Add-ons."""

    bl_idname = __package__

    binary: StringProperty(name="Command", subtype="FILE_PATH", options=RELATIVE,
                           description="The command cloudvdb, or its folder. Empty: the one beside the add-on, else the one on the PATH")

    def draw(self, context):
        layout = self.layout
        layout.prop(self, "binary")
        row = layout.row()
        row.operator("cloudvdb.check", icon="CHECKMARK")


class CLOUDVDB_OT_check(bpy.types.Operator):
    """Looks for the command, and says which it is"""

    bl_idname = "cloudvdb.check"
    bl_label = "Check Command"

    def execute(self, context):
        try:
            path = binary.check(preferences(context))
        except CloudError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"cloudvdb {binary.version(path)} at {path}")
        return {"FINISHED"}


def preferences(context):
    """The add-on's preferences; `None` where it runs without being enabled."""
    addon = context.preferences.addons.get(__package__)
    return addon.preferences if addon else None


CLASSES = (CloudPreferences, CLOUDVDB_OT_check)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
