# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
settings = bpy.context.scene.cloudvdb_settings

settings.medium = 'AUTO'
settings.emission = 0.0
settings.temperature = 0.0
settings.detail = 'AUTO'
settings.density = 'duality'
settings.photons = 1000000
settings.model = 'physical'
settings.placement = 'uniform'
settings.resolution = 'AUTO'
settings.max_voxels = 16777216
