# SPDX-License-Identifier: GPL-3.0-or-later
"""Metaballs come back when Blender's importer reads the extension that the export wrote."""
import bpy

from . import metaballs


class glTF2ImportUserExtension:
    """The hooks that Blender's importer calls, as it finds them by the class's name."""

    def __init__(self):
        from io_scene_gltf2.io.com.gltf2_io_extensions import Extension
        self.extensions = [Extension(name=metaballs.EXTENSION, extension={}, required=False)]

    def gather_import_scene_after_nodes_hook(self, gltf_scene, blender_scene, gltf):
        """All empties are there: those with the extension are replaced by metaballs."""
        for index, node in enumerate(gltf.data.nodes or []):
            value = (node.extensions or {}).get(metaballs.EXTENSION)
            vnode = gltf.vnodes.get(index)
            empty = getattr(vnode, "blender_object", None)
            if value and empty is not None and empty.type == "EMPTY":
                vnode.blender_object = replace(empty, value)


def replace(empty, value):
    """A metaball in an empty's place, with its name, transforms, relations and custom properties."""
    name = empty.name
    thing = bpy.data.objects.new(name, metaballs.from_extension(value, name))
    for collection in empty.users_collection:
        collection.objects.link(thing)
    thing.parent, thing.parent_type, thing.parent_bone = empty.parent, empty.parent_type, empty.parent_bone
    thing.matrix_parent_inverse = empty.matrix_parent_inverse
    thing.rotation_mode = empty.rotation_mode
    thing.matrix_basis = empty.matrix_basis
    for key in empty.keys():
        if key not in ("cloudvdb_record",):
            thing[key] = empty[key]
    for child in list(empty.children):
        inverse = child.matrix_parent_inverse.copy()
        child.parent, child.matrix_parent_inverse = thing, inverse
    bpy.data.objects.remove(empty)
    thing.name = name
    return thing
