# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
settings = bpy.context.scene.cloudvdb_settings

settings.medium = 'hura2006'
settings.detail = 'none'
settings.density = 'duality'
settings.model = 'hura2006'
settings.placement = 'uniform'
settings.photons = 1000000
