# SPDX-License-Identifier: GPL-3.0-or-later
"""cloudvdb in Blender: a button that turns a layout into a photon-cloud volume."""
from . import panel, preferences, presets, regions, scene_operators, settings, synthesise, takes
from .gltf_export import glTF2ExportUserExtension  # noqa: F401  Blender's exporter looks for it here.
from .gltf_import import glTF2ImportUserExtension  # noqa: F401  And its importer for this.

# For Blender 3.4 to 4.1; later ones read blender_manifest.toml.
bl_info = {
    "name": "cloudvdb: Photon Clouds",
    "author": "cloudvdb contributors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "3D View > Sidebar > Cloud",
    "description": "Turns metaballs, spheres and meshes into photon-cloud volumes",
    "category": "Object",
}

MODULES = (preferences, settings, takes, presets, synthesise, scene_operators, regions, panel)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
