# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
settings = bpy.context.scene.cloudvdb_settings

settings.medium = 'AUTO'
settings.detail = 'congestus'
settings.detail_size = 0.0
settings.detail_strength = 1.0
settings.detail_octaves = 5
settings.max_voxels = 16777216
