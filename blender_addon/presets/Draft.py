# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
settings = bpy.context.scene.cloudvdb_settings

settings.density = 'duality'
settings.photons = 100000
settings.resolution = 'AUTO'
settings.max_voxels = 1000000
