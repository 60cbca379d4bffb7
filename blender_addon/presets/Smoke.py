# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
settings = bpy.context.scene.cloudvdb_settings

settings.medium = 'smoke'
settings.detail = 'AUTO'
