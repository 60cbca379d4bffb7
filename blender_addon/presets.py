# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of the panel, the Blender way: those that come with the add-on, and the user's own."""
import os

import bpy
from bl_operators.presets import AddPresetBase

SUBDIR = "cloudvdb"
SHIPPED = os.path.join(os.path.dirname(os.path.abspath(__file__)), "presets")
FIELDS = ("medium", "sigma_t", "albedo", "anisotropy", "emission", "emission_color", "temperature", "detail", "detail_size", "detail_strength", "detail_octaves", "detail_seed", "density",
          "photons", "model", "placement", "seed", "resolution", "voxel_size", "max_voxels", "bake")


class CLOUDVDB_MT_presets(bpy.types.Menu):
    """Medium, detail, photons and resolution in one go"""

    bl_label = "Cloud Presets"
    preset_subdir = SUBDIR
    preset_operator = "script.execute_preset"

    def draw(self, context):
        self.path_menu([SHIPPED, *bpy.utils.preset_paths(SUBDIR)], self.preset_operator, props_default={"menu_idname": "CLOUDVDB_MT_presets"},
                       filter_ext=lambda ext: ext.lower() == ".py")


class CLOUDVDB_OT_preset(AddPresetBase, bpy.types.Operator):
    """Keeps these settings under a name, or forgets the chosen preset"""

    bl_idname = "cloudvdb.preset"
    bl_label = "Cloud Preset"
    preset_menu = "CLOUDVDB_MT_presets"
    preset_defines = ["settings = bpy.context.scene.cloudvdb_settings"]
    preset_values = [f"settings.{name}" for name in FIELDS]
    preset_subdir = SUBDIR


CLASSES = (CLOUDVDB_MT_presets, CLOUDVDB_OT_preset)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
