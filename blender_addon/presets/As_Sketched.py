# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
settings = bpy.context.scene.cloudvdb_settings

settings.density = 'source'
settings.detail = 'none'
settings.resolution = 'AUTO'
