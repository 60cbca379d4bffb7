# SPDX-License-Identifier: GPL-3.0-or-later
"""A VDB becomes a Volume object where its layout is."""
import bpy
from mathutils import Matrix

from . import baking, layout, material, vdb_metadata

COLLECTION = "Clouds"
#: Optical depth across a cloud in the Solid view, at most.
SOLID = 8.0


def place(scene, things, name, path, report, settings, frames=None, history=()):
    """Puts the grid at `path` into the scene: a new Volume, or in place of the one that this layout made before, whose transforms
    and material stay. `frames` is (first, count) of a sequence, `history` what each was told (`baking.cloud`). Returns the object and sentences for the user."""
    cloud = layout.existing(scene, things)
    told = []
    if cloud is None:
        cloud = bpy.data.objects.new(name, bpy.data.volumes.new(name))
        collection_of(scene).objects.link(cloud)
    record = cloud.cloudvdb_record
    load(cloud.data, path, frames)
    # Blender before 5.0 takes a voxel's centre for its corner.
    offset = -0.5 * report["vdb"]["voxel_size"] if bpy.app.version < (5, 0, 0) else 0.0
    moved = Matrix.Translation((offset - record.offset,) * 3)
    cloud.matrix_basis = cloud.matrix_basis @ moved
    known = baking.cloud(report, vdb_metadata.read(path), history)
    medium = (known["density"], known["albedo"][0], known["anisotropy"])
    told += material.dress(cloud, known) + baking.advice(scene, known)
    # Thick clouds are flat shapes in the Solid view: there they are as thin as light and shade can be seen.
    bpy.context.view_layer.update()
    cloud.data.display.density = min(medium[0], SOLID / max(*cloud.dimensions, 1e-6))
    record.density, record.albedo, record.anisotropy = medium
    record.offset, record.made = offset, True
    hide(cloud, things)
    if settings.set_bounces:
        told += material.raise_bounces(scene)
    return cloud, told


def load(volume, path, frames):
    """Points a Volume at a file, or at the first of a sequence."""
    volume.grids.unload()
    volume.is_sequence = frames is not None
    volume.filepath = relative(path)
    if frames:
        first, count = frames
        volume.frame_start, volume.frame_duration, volume.frame_offset = first, count, first - 1
        volume.sequence_mode = "CLIP"
    volume.grids.load()


def relative(path):
    """The path as a saved .blend keeps it."""
    if not bpy.data.filepath:
        return path
    try:
        return bpy.path.relpath(path)
    except ValueError:  # on another drive
        return path


def collection_of(scene):
    """The scene's collection of clouds."""
    found = scene.collection.children.get(COLLECTION)
    if found is None:
        found = bpy.data.collections.new(COLLECTION)
        scene.collection.children.link(found)
    return found


def hide(cloud, things):
    """Takes the layout out of renders, and shows it as boxes, for it would hide the cloud; what it was before stays with the cloud."""
    record = cloud.cloudvdb_record
    before = {item.object: (item.display_type, item.hide_render) for item in record.layout if item.object}
    record.layout.clear()
    for thing in things:
        item = record.layout.add()
        item.object = thing
        item.display_type, item.hide_render = before.get(thing, (thing.display_type, thing.hide_render))
        thing.hide_render = True
        thing.display_type = "BOUNDS"


def unhide(cloud):
    """Shows the layout as it was before the cloud."""
    for item in cloud.cloudvdb_record.layout:
        if item.object:
            item.object.hide_render, item.object.display_type = item.hide_render, item.display_type or "TEXTURED"
