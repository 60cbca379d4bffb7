# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's settings, and what a cloud remembers of how it was made."""
import bpy
from bpy.props import (BoolProperty, CollectionProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, PointerProperty,
                       StringProperty)

MEDIA = [
    ("AUTO", "As Objects Say", "What the objects' custom property cloudvdb says; without one a medium of which the largest part has "
                               "optical depth 40, so that a cloud of any size is thick"),
    ("cumulus", "Cumulus", "Water droplets: extinction 0.06 per metre, albedo 0.9999, g 0.86. For clouds of hundreds of metres"),
    ("stratus", "Stratus", "Water droplets: extinction 0.03 per metre, albedo 0.9999, g 0.85. For decks of hundreds of metres"),
    ("cirrus", "Cirrus", "Ice: extinction 0.0005 per metre, albedo 0.9999, g 0.77. For kilometres"),
    ("haze", "Haze", "Extinction 0.0002 per metre, albedo 0.95, g 0.7. For kilometres"),
    ("smoke", "Smoke", "Extinction 1 per metre, albedo 0.6, g 0.5. For metres"),
    ("hura2006", "Hura 2006", "The thesis's table 2: extinction 1 per metre, albedo 0.8, g 0.9"),
    ("milk", "Milk", "Whole milk: extinction 2551 to 3784 per metre. For centimetres"),
    ("skim_milk", "Skim Milk", "Extinction 701 to 1914 per metre. For centimetres"),
    ("cream", "Cream", "Extinction 7380 to 3166 per metre. For centimetres"),
    ("skin", "Skin", "Extinction 772 to 1490 per metre, albedo 0.96 in red, 0.68 in blue. For centimetres"),
    ("marble", "Marble", "Extinction 2192 to 3007 per metre. For centimetres"),
    ("apple", "Apple", "Its flesh: extinction 2293 to 2016 per metre. For centimetres"),
    ("potato", "Potato", "Extinction 682 to 670 per metre. For centimetres"),
    ("chicken", "Chicken", "Extinction 165 to 570 per metre. For centimetres"),
    ("ketchup", "Ketchup", "Extinction 241 to 1480 per metre, albedo 0.75 in red, 0.02 in blue. For centimetres"),
    ("CUSTOM", "Custom", "Extinction, albedo and anisotropy by number"),
]
DETAILS = [
    ("AUTO", "As Objects Say", "What the objects' custom property cloudvdb says; without one none"),
    ("none", "None", "Smooth, as laid out"),
    ("humilis", "Humilis", "Small rounded bumps: fair-weather cumulus"),
    ("congestus", "Congestus", "Cauliflower: towering cumulus"),
    ("stratocumulus", "Stratocumulus", "Rolls and patches of a low deck"),
    ("altocumulus", "Altocumulus", "Small flakes of a middle deck"),
    ("cirrus", "Cirrus", "Fibres along x"),
]
BAKES = [
    ("none", "None", "The cloud scatters light by itself: true for any camera and light, and slow to render"),
    ("view", "For this Camera", "What goes toward the scene's camera, all orders of scattering at once: the truest picture from there. The camera "
                                "may turn, but not move"),
    ("sh2", "Any View", "What goes in all directions: the sun's peaks, the rest by harmonics up to degree 3. Nineteen grids or more"),
    ("isotropic", "Any View, smallest", "The mean over all directions: one grid, without the bright rims toward the sun"),
]


#: Blender 4.5 and later want to be told that // is understood.
RELATIVE = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()


class CloudSettings(bpy.types.PropertyGroup):
    """What the panel Cloud shows."""

    source: EnumProperty(
        name="Layout", default="SELECTION", description="What the cloud is made of",
        items=[("SELECTION", "Selection", "The selected metaballs (families whole), spheres, closed meshes, sphere empties; or the layout of the "
                                          "selected cloud"),
               ("COLLECTION", "Collection", "What is visible in a collection")])
    collection: PointerProperty(name="Collection", type=bpy.types.Collection, description="The collection with the layout")
    surroundings: BoolProperty(
        name="Surroundings", default=False,
        description="Meshes that are not of the layout, and that renders show, shade the cloud and reflect light into it. Exporting them takes time")
    lamps: BoolProperty(
        name="Lamps", default=False,
        description="Point and spot lights that renders show light the cloud too: its photons, and what is baked. A spot's edge is glTF's, a little wider")

    medium: EnumProperty(name="Medium", items=MEDIA, default="AUTO", description="What fills objects that do not say so themselves")
    sigma_t: FloatProperty(name="Extinction", default=0.06, min=1e-9, soft_min=1e-4, soft_max=10, precision=4,
                           description="Extinction coefficient, per metre: the inverse of the mean free path")
    albedo: FloatProperty(name="Albedo", default=0.9999, min=0, max=1, precision=4, description="Single-scattering albedo, 0 to 1")
    anisotropy: FloatProperty(name="Anisotropy", default=0.86, min=-0.999, max=0.999, precision=3,
                              description="g, the mean cosine of scattering, -1 to 1; forward is positive")
    emission: FloatProperty(name="Emission", default=0, min=0, soft_max=1000, precision=3,
                            description="What objects send out by themselves that do not say so: W per cubic metre and steradian, as an Emission "
                                        "node's Strength. Where anything shines, no sun is assumed")
    emission_color: FloatVectorProperty(name="Color", subtype="COLOR", size=3, default=(1.0, 0.3, 0.05), min=0, max=1,
                                        description="The colour of the emission")
    temperature: FloatProperty(name="Temperature", default=0, min=0, soft_max=6500, precision=0,
                               description="Kelvin: a medium that absorbs glows as a black body of that heat; 0 is cold")

    detail: EnumProperty(name="Detail", items=DETAILS, default="AUTO", description="Turbulence at the boundary, by genus of cloud")
    detail_size: FloatProperty(name="Size", default=0, min=0, soft_max=500, subtype="DISTANCE", unit="LENGTH",
                               description="Size of the largest bumps in metres; 0 takes the mean radius of the layout's parts")
    detail_strength: FloatProperty(name="Strength", default=1, min=0, max=4, soft_max=2, description="0 is smooth, 1 the genus")
    detail_octaves: IntProperty(name="Octaves", default=5, min=1, max=10, description="Bumps upon bumps: each octave is half as large")
    detail_seed: IntProperty(name="Detail Seed", default=0, min=0, description="Another seed, other bumps")

    density: EnumProperty(
        name="Cloud", default="duality", description="Which medium is written",
        items=[("duality", "Photon Clouds", "New regions where light scatters more than once: the photon-particle duality"),
               ("source", "As Sketched", "The layout itself as a volume, without photons changing it")])
    photons: IntProperty(name="Photons", default=1_000_000, min=1_000, soft_max=20_000_000, max=1_000_000_000,
                         description="Photons to store. More of them make more and finer regions, and take longer (10 million: some 5 s)")
    model: EnumProperty(
        name="Model", default="physical", description="How the thesis is read",
        items=[("physical", "Physical", "Energy is conserved"), ("hura2006", "Hura 2006", "The thesis's text to the letter, traps included")])
    placement: EnumProperty(
        name="Placement", default="uniform", description="Where candidates for regions are drawn",
        items=[("uniform", "Uniform", "Anywhere in a region (the thesis)"), ("importance", "Importance", "At its photons (its future work)")])
    seed: IntProperty(name="Seed", default=0, min=0, description="The same seed gives the same cloud, byte for byte; sequences keep it in every frame")

    resolution: EnumProperty(
        name="Resolution", default="AUTO", description="How the voxel size is found",
        items=[("AUTO", "Automatic", "A third of the smallest region's half extent or of the smallest detail, within the most voxels"),
               ("SIZE", "Voxel Size", "By the size of a voxel; refused where it takes more than the most voxels")])
    voxel_size: FloatProperty(name="Voxel Size", default=0.05, min=1e-6, soft_min=1e-3, precision=4, subtype="DISTANCE", unit="LENGTH",
                              description="Edge of a voxel in metres")
    max_voxels: IntProperty(name="Most Voxels", default=16_777_216, min=1_000, max=2_000_000_000,
                            description="The most active voxels of a grid; automatic sizes are coarsened to fit")
    bake: EnumProperty(name="Bake Light", items=BAKES, default="none",
                       description="Light that goes into grids beside the density, so that renders need no bounces. It is that of the Sun and the sky "
                                   "of now: press again when they change")
    folder: StringProperty(name="Output", default="//clouds/", subtype="DIR_PATH", options=RELATIVE,
                           description="Where VDBs go; // is the folder of the .blend file")
    set_bounces: BoolProperty(name="Raise Volume Bounces", default=True,
                              description="Raises Cycles' bounces, Total and Volume, to at least 64: with the defaults clouds are dark")

    frame_start: IntProperty(name="Start", default=1, min=0, max=9999, description="First frame of the sequence")
    frame_end: IntProperty(name="End", default=24, min=0, max=9999, description="Last frame of the sequence")
    message: StringProperty(name="Message", description="What the last run said", options={"SKIP_SAVE"})


class LayoutItem(bpy.types.PropertyGroup):
    """One object of a cloud's layout, and how it was shown before."""

    object: PointerProperty(type=bpy.types.Object)
    display_type: StringProperty()
    hide_render: BoolProperty()


class CloudRecord(bpy.types.PropertyGroup):
    """How a Volume object was made."""

    made: BoolProperty(description="Whether Synthesise Cloud made it")
    layout: CollectionProperty(type=LayoutItem)
    offset: FloatProperty(description="How far the object was moved along each axis to lie where its layout is, m")
    density: FloatProperty(description="Extinction per metre of a sample of 1, as the material was given it")
    albedo: FloatProperty(description="Albedo, as the material was given it")
    anisotropy: FloatProperty(description="g, as the material was given it")
    bake: StringProperty(default="none", description="The baked light that the material shows")
    look: StringProperty(description="A print of the material as it was made, to see whether it was changed")
    glow: StringProperty(description="A print of the material's group of baked light as it was made")


CLASSES = (CloudSettings, LayoutItem, CloudRecord)
register_classes, unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def register():
    register_classes()
    bpy.types.Scene.cloudvdb_settings = PointerProperty(type=CloudSettings)
    bpy.types.Object.cloudvdb_record = PointerProperty(type=CloudRecord)


def unregister():
    del bpy.types.Object.cloudvdb_record
    del bpy.types.Scene.cloudvdb_settings
    unregister_classes()
