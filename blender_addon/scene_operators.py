# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons for new layouts."""
import random

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty
from mathutils import Vector

from . import gltf_export, scenes


class Adds:
    """What all of them share."""

    bl_options = {"REGISTER", "UNDO"}

    seed: IntProperty(name="Seed", default=0, min=0, description="Another seed, another layout")
    sun: BoolProperty(name="Sun and Sky", default=True, description="Adds a Sun where the scene has none, and a blue sky in place of a grey one")

    @classmethod
    def poll(cls, context):
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave Edit Mode first (Tab)")
        return context.mode == "OBJECT"

    def light(self, context):
        """A Sun, where one is asked for and none is there."""
        if self.sun and not gltf_export.suns(context.scene):
            scenes.sun_and_sky(context)


class CLOUDVDB_OT_add_cumulus(Adds, bpy.types.Operator):
    """Adds a cumulus of metaballs at the 3D cursor, and selects it"""

    bl_idname = "cloudvdb.add_cumulus"
    bl_label = "Cumulus"

    width: FloatProperty(name="Width", default=4.5, min=1e-3, soft_max=3000, subtype="DISTANCE", unit="LENGTH", description="In metres")
    height: FloatProperty(name="Height", default=2.8, min=1e-3, soft_max=3000, subtype="DISTANCE", unit="LENGTH", description="In metres, base to top")
    puffs: IntProperty(name="Towers", default=14, min=1, max=200, description="How many columns of metaballs")

    def execute(self, context):
        name = scenes.family_name("Cumulus")
        thing = scenes.cumulus(context, name, context.scene.cursor.location, self.width, self.height, self.puffs, random.Random(self.seed))
        self.light(context)
        scenes.select(context, [thing])
        return {"FINISHED"}


class CLOUDVDB_OT_scatter_field(Adds, bpy.types.Operator):
    """Scatters cumuli over a square around the 3D cursor, and selects them: one press of Synthesise Cloud makes one volume of all"""

    bl_idname = "cloudvdb.scatter_field"
    bl_label = "Field of Clouds"

    size: FloatProperty(name="Size", default=40, min=1e-2, soft_max=20000, subtype="DISTANCE", unit="LENGTH", description="Side of the square in metres")
    count: IntProperty(name="Clouds", default=9, min=1, max=200)
    width: FloatProperty(name="Width", default=7, min=1e-3, soft_max=3000, subtype="DISTANCE", unit="LENGTH",
                         description="Mean width of a cloud in metres")
    base: FloatProperty(name="Base", default=0, subtype="DISTANCE", unit="LENGTH", description="Height of the flat bases in metres, above the cursor")

    def execute(self, context):
        chance, places, made = random.Random(self.seed), [], []
        for _ in range(self.count):
            # Of some random places the one farthest from all others: even, but no grid.
            tries = [Vector((chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5), 0)) * self.size for _ in range(12)]
            places.append(max(tries, key=lambda p: min(((p - q).length for q in places), default=0)))
        for place in places:
            width = self.width * chance.lognormvariate(-0.06, 0.35)
            at = context.scene.cursor.location + place + Vector((0, 0, self.base))
            made.append(scenes.cumulus(context, scenes.family_name("Cumulus"), at, width, width * chance.uniform(0.35, 0.7), 8, chance))
        self.light(context)
        scenes.select(context, made)
        return {"FINISHED"}


class CLOUDVDB_OT_sunbeams(Adds, bpy.types.Operator):
    """Makes a scene with sunbeams: a deck of clouds with gaps before the Sun, thin haze below, a camera. Synthesise Cloud, then render"""

    bl_idname = "cloudvdb.sunbeams"
    bl_label = "Sunbeam Scene"

    haze: FloatProperty(name="Haze", default=0.03, min=0, soft_max=0.1, precision=4, description="Scattering of the haze, per metre")

    def execute(self, context):
        chance, made = random.Random(self.seed), []
        made.append(scenes.deck(context, scenes.family_name("Deck"), (0, 14, 16), (36, 24), 8, chance))
        if self.sun:
            scenes.sun_and_sky(context, toward=(0.1, 0.4, 0.9), strength=20.0, sky=0.03)
        # Below the clouds only: light that has come through a gap is seen against haze that has got none.
        scenes.haze(context, "Haze", (56, 30, 14.5), (0, 14, 7.25), self.haze)
        scenes.camera(context, (0, -30, 3), (0, 14, 10), 0.9)
        scenes.select(context, made)
        return {"FINISHED"}


class CLOUDVDB_OT_add_sun(bpy.types.Operator):
    """Adds a Sun half way up, and a blue sky in place of a grey one"""

    bl_idname = "cloudvdb.add_sun"
    bl_label = "Sun and Sky"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        scenes.sun_and_sky(context)
        return {"FINISHED"}


CLASSES = (CLOUDVDB_OT_add_cumulus, CLOUDVDB_OT_scatter_field, CLOUDVDB_OT_sunbeams, CLOUDVDB_OT_add_sun)
register_classes, unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def menu(self, context):
    """Add > Volume."""
    self.layout.operator(CLOUDVDB_OT_add_cumulus.bl_idname, text="Cumulus of Metaballs", icon="META_BALL")


def register():
    register_classes()
    bpy.types.VIEW3D_MT_volume_add.append(menu)


def unregister():
    bpy.types.VIEW3D_MT_volume_add.remove(menu)
    unregister_classes()
