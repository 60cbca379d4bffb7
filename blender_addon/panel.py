# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Cloud in the 3D view's sidebar."""
import sys
import textwrap

import bpy

from . import binary, gltf_export, layout, scene_operators, synthesise
from .errors import CloudError
from .preferences import preferences


class Panel:
    """Where all of them are."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Cloud"

    def grow(self, context):
        """A column of properties with their names in front, as Blender has it."""
        column = self.layout.column()
        column.use_property_split, column.use_property_decorate = True, False
        return column, context.scene.cloudvdb_settings


class CLOUDVDB_PT_cloud(Panel, bpy.types.Panel):
    bl_idname = "CLOUDVDB_PT_cloud"
    bl_label = "Cloud"

    def draw(self, context):
        settings, column = context.scene.cloudvdb_settings, self.layout.column()
        row = column.row(align=True)
        row.menu("CLOUDVDB_MT_presets", text=bpy.types.CLOUDVDB_MT_presets.bl_label)
        row.operator("cloudvdb.preset", text="", icon="ADD")
        row.operator("cloudvdb.preset", text="", icon="REMOVE").remove_active = True
        column.row().prop(settings, "source", expand=True)
        if settings.source == "COLLECTION":
            column.prop(settings, "collection", text="")
        column.row().prop(settings, "density", expand=True)
        column.separator()
        self.draw_button(context, column)
        if not gltf_export.suns(context.scene):
            column.operator("cloudvdb.add_sun", icon="LIGHT_SUN", text="No Sun: Add Sun and Sky")
        if context.scene.render.engine != "CYCLES" and "CYCLES" in {getattr(e, "bl_idname", "") for e in bpy.types.RenderEngine.__subclasses__()}:
            column.operator("cloudvdb.use_cycles", icon="RENDER_STILL")
        if settings.message:
            write(column.box(), settings.message.split("\n")[0], context)

    def draw_button(self, context, column):
        """The button; while it is at work, how far it is."""
        task = synthesise.running
        if task:
            text = f"{task.stage()}  {100 * task.fraction():.0f} %"
            row = column.row(align=True)
            row.scale_y = 1.6
            if hasattr(row, "progress"):
                row.progress(factor=task.fraction(), text=text)
            else:
                row.label(text=text, icon="SORTTIME")
            row.operator("cloudvdb.cancel", text="", icon="X")
            return
        row = column.row()
        row.scale_y = 1.6
        row.operator("cloudvdb.synthesise", icon="OUTLINER_OB_VOLUME" if not layout.missing(context, context.scene.cloudvdb_settings) else "INFO")
        reason = layout.missing(context, context.scene.cloudvdb_settings)
        if reason:
            write(column, reason, context)


class CLOUDVDB_PT_layout(Panel, bpy.types.Panel):
    bl_label = "New Layout"
    bl_parent_id = "CLOUDVDB_PT_cloud"

    def draw(self, context):
        column = self.layout.column(align=True)
        for cls, icon in zip(scene_operators.CLASSES, ("META_BALL", "OUTLINER_OB_META", "LIGHT_SPOT", "LIGHT_SUN")):
            column.operator(cls.bl_idname, icon=icon)


class CLOUDVDB_PT_notes(Panel, bpy.types.Panel):
    bl_label = "Notes"
    bl_parent_id = "CLOUDVDB_PT_cloud"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return "\n" in context.scene.cloudvdb_settings.message

    def draw(self, context):
        for note in context.scene.cloudvdb_settings.message.split("\n")[1:]:
            write(self.layout.box(), note, context)


class CLOUDVDB_PT_medium(Panel, bpy.types.Panel):
    bl_label = "Medium and Detail"
    bl_parent_id = "CLOUDVDB_PT_cloud"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, settings = self.grow(context)
        column.prop(settings, "medium")
        if settings.medium == "CUSTOM":
            for name in ("sigma_t", "albedo", "anisotropy"):
                column.prop(settings, name)
        column.prop(settings, "emission")
        if settings.emission > 0:
            column.prop(settings, "emission_color")
        column.prop(settings, "temperature")
        column.prop(settings, "detail")
        if settings.detail not in ("AUTO", "none"):
            for name in ("detail_size", "detail_strength", "detail_octaves", "detail_seed"):
                column.prop(settings, name)
        column.prop(settings, "surroundings")
        column.prop(settings, "lamps")


class CLOUDVDB_PT_photons(Panel, bpy.types.Panel):
    bl_label = "Photons and Resolution"
    bl_parent_id = "CLOUDVDB_PT_cloud"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, settings = self.grow(context)
        for name in ("photons", "model", "placement", "seed"):
            column.prop(settings, name)
        column.separator()
        column.prop(settings, "resolution")
        if settings.resolution == "SIZE":
            column.prop(settings, "voxel_size")
        column.prop(settings, "max_voxels")


class CLOUDVDB_PT_output(Panel, bpy.types.Panel):
    bl_label = "Output"
    bl_parent_id = "CLOUDVDB_PT_cloud"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, settings = self.grow(context)
        for name in ("bake", "folder", "set_bounces"):
            column.prop(settings, name)
        try:
            column.label(text=binary.locate(preferences(context)), icon="CONSOLE")
        except CloudError as error:
            write(column, str(error), context)


class CLOUDVDB_PT_animation(Panel, bpy.types.Panel):
    bl_label = "Animation"
    bl_parent_id = "CLOUDVDB_PT_cloud"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, settings = self.grow(context)
        pair = column.column(align=True)
        pair.prop(settings, "frame_start")
        pair.prop(settings, "frame_end")
        column.operator("cloudvdb.synthesise_sequence", icon="RENDER_ANIMATION")


class CLOUDVDB_PT_regions(Panel, bpy.types.Panel):
    bl_label = "Regions"
    bl_parent_id = "CLOUDVDB_PT_cloud"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column = self.layout.column()
        column.operator_menu_enum("cloudvdb.bring_regions", "form", icon="SPHERE")
        column.operator("cloudvdb.import_regions", icon="IMPORT")


class CLOUDVDB_PT_result(Panel, bpy.types.Panel):
    bl_label = "Active Cloud"
    bl_parent_id = "CLOUDVDB_PT_cloud"

    @classmethod
    def poll(cls, context):
        return context.object is not None and layout.is_cloud(context.object)

    def draw(self, context):
        column, record = self.layout.column(), context.object.cloudvdb_record
        column.label(text=f"Density {record.density:.5g} per metre, g {record.anisotropy:.3g}")
        column.operator("cloudvdb.show_layout", icon="UV_SYNC_SELECT")


class CLOUDVDB_OT_use_cycles(bpy.types.Operator):
    """Renders with Cycles, where light scatters in clouds as often as it does (EEVEE follows it once); with 64 samples and Denoise, where
    the samples are Blender's default"""

    bl_idname = "cloudvdb.use_cycles"
    bl_label = "Render with Cycles"
    bl_options = {"UNDO"}

    def execute(self, context):
        context.scene.render.engine = "CYCLES"
        cycles, told = context.scene.cycles, "Render Engine: Cycles"
        if cycles.samples == cycles.bl_rna.properties["samples"].default:
            cycles.samples = 64
            told += "; Max Samples 64"
        # Some distributions build Cycles without its denoiser.
        if getattr(sys.modules.get("_cycles"), "with_openimagedenoise", False):
            cycles.use_denoising, cycles.denoiser = True, "OPENIMAGEDENOISE"
            told += "; Denoise on"
        self.report({"INFO"}, told)
        return {"FINISHED"}


def write(column, text, context):
    """Words of any length in a narrow panel."""
    width = max(20, int(context.region.width / (8 * context.preferences.system.ui_scale))) if context.region else 40
    rows = column.column(align=True)
    rows.scale_y = 0.8
    for paragraph in text.split("\n"):
        for line in textwrap.wrap(paragraph, width):
            rows.label(text=line)


CLASSES = (CLOUDVDB_PT_cloud, CLOUDVDB_PT_notes, CLOUDVDB_PT_layout, CLOUDVDB_PT_result, CLOUDVDB_PT_medium, CLOUDVDB_PT_photons, CLOUDVDB_PT_output,
           CLOUDVDB_PT_animation, CLOUDVDB_PT_regions, CLOUDVDB_OT_use_cycles)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
