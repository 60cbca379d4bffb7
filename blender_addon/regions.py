# SPDX-License-Identifier: GPL-3.0-or-later
"""Synthesised regions, as `cloudvdb -o regions.glb` writes them, come back as empties or metaballs."""
import json
import os
import struct

import bpy
from bpy.props import EnumProperty, StringProperty
from mathutils import Matrix

from . import gltf_export, layout, media, metaballs, result
from .errors import CloudError
from .synthesise import Runs
from .task import Task, scene_of

#: A stiff field ends close to its surface: balls that touch bulge little.
STIFFNESS = 10.0
AS = [("EMPTY", "Empties", "A sphere empty for each region, with its medium: exactly the regions. They can be synthesised again"),
      ("METABALL", "Metaballs", "One metaball object for each medium, an element for each region: they melt where they touch")]


def read(path):
    """The document of a .glb or .gltf. Raises `CloudError`."""
    try:
        with open(path, "rb") as file:
            data = file.read()
        if data[:4] == b"glTF":
            (length,) = struct.unpack_from("<I", data, 12)
            data = data[20:20 + length]
        return json.loads(data)
    except OSError as error:
        raise CloudError(f"{path} cannot be read ({error.strerror}): choose what cloudvdb -o regions.glb wrote") from error
    except (ValueError, struct.error) as error:
        raise CloudError(f"{path} is no glTF file ({error}): choose what cloudvdb -o regions.glb wrote") from error


def balls(document):
    """The regions that are balls or ellipsoids, as (name, from the unit ball to Blender's world, the property `cloudvdb`), and how
    many regions have another shape."""
    nodes, found, others = document.get("nodes", []), [], 0

    def visit(index, above):
        nonlocal others
        node = nodes[index]
        world = above @ metaballs.from_gltf_matrix(node)
        said = media.spec((node.get("extras") or {}).get(media.KEY)) or {}
        if said.get("shape") == "sphere":
            # Meshes of cloudvdb's are unit balls; an empty's radius is said.
            radius = 1.0 if "mesh" in node else said.get("radius", 1.0)
            found.append((node.get("name", "Region"), metaballs.z_up(world) @ Matrix.Diagonal((radius, radius, radius, 1)), said))
        elif said.get("shape") in ("slab", "mesh"):
            others += 1
        for child in node.get("children", []):
            visit(child, world)

    for root in document.get("scenes", [{}])[document.get("scene", 0)].get("nodes", []):
        visit(root, Matrix())
    return found, others


def as_empties(collection, found):
    """A sphere empty for each."""
    made = []
    for name, world, said in found:
        thing = bpy.data.objects.new(name, None)
        thing.empty_display_type, thing.empty_display_size, thing.matrix_world = "SPHERE", 1.0, world
        thing[media.KEY] = {**said, "radius": 1.0}
        collection.objects.link(thing)
        made.append(thing)
    return made


def as_metaballs(collection, found, name):
    """A metaball object for each medium, an element for each region."""
    groups, made = {}, []
    for _, world, said in found:
        medium = {key: value for key, value in said.items() if key not in ("shape", "radius", "photons")}
        groups.setdefault(json.dumps(medium, sort_keys=True), []).append(world)
    for number, (medium, worlds) in enumerate(groups.items()):
        label = name if number == 0 else f"{name} {number + 1}"
        data = bpy.data.metaballs.new(label)
        thing = bpy.data.objects.new(label, data)
        sizes = []
        for world in worlds:
            place, turn, scale = world.decompose()
            radius = max(scale)
            one = data.elements.new(type="BALL" if min(scale) > 0.999 * radius else "ELLIPSOID")
            one.co, one.rotation, one.stiffness = place, turn, STIFFNESS
            one.radius = radius / metaballs.visible(data.threshold, STIFFNESS)
            one.size_x, one.size_y, one.size_z = (s / radius for s in scale)
            sizes.append(radius)
        metaballs.show(data, 2 * sorted(sizes)[len(sizes) // 2])
        thing[media.KEY] = json.loads(medium)
        collection.objects.link(thing)
        made.append(thing)
    return made


def bring(context, path, name, form):
    """Reads regions into a collection of their own, and selects them; a sentence on what came. Raises `CloudError`."""
    found, others = balls(read(path))
    if not found:
        raise CloudError(f"{path} holds no spherical regions: choose what cloudvdb -o regions.glb wrote")
    collection = bpy.data.collections.new(name)
    context.scene.collection.children.link(collection)
    made = as_empties(collection, found) if form == "EMPTY" else as_metaballs(collection, found, metaballs.family(name))
    for other in context.selected_objects:
        other.select_set(False)
    for thing in made:
        thing.select_set(True)
    context.view_layer.objects.active = made[0]
    left = f"; {others} slabs or meshes were left out, which File > Import > glTF brings" if others else ""
    return f'{len(found)} regions in the collection "{collection.name}"{left}'


class RegionsTask(Task):
    """The regions that the duality makes of a layout, as objects. Metaballs take part by the mesh that Blender makes of them, for
    their own fields are voxels to the command, and voxels have no place in glTF."""

    OUTPUT = "regions.glb"

    def __init__(self, context, form):
        self.form = form
        super().__init__(context)

    def output_folder(self, settings):
        return os.path.join(bpy.app.tempdir, "regions"), ""

    def layout_file(self):
        scene, layer = scene_of(self.scene), bpy.context.view_layer
        things, stand_ins = self.things(scene), []
        depsgraph = bpy.context.evaluated_depsgraph_get()
        try:
            for thing in things:
                if thing.type == "META":
                    # Of a family only the first object has a mesh: that of all.
                    mesh = bpy.data.meshes.new_from_object(thing.evaluated_get(depsgraph))
                    stand_in = bpy.data.objects.new(thing.name, mesh)
                    stand_in.matrix_world = thing.matrix_world
                    stand_in[media.KEY] = {**(media.spec(thing.get(media.KEY, {})) or {}), "shape": "mesh" if mesh.polygons else "ignore"}
                    scene.collection.objects.link(stand_in)
                    stand_ins.append(stand_in)
            layer.update()
            path = self.workshop.file("layout.glb")
            layout_now = [thing for thing in things if thing.type != "META"] + stand_ins
            gltf_export.write(path, gltf_export.Request(scene, layout_now, scene.cloudvdb_settings))
            return path
        finally:
            for stand_in in stand_ins:
                bpy.data.meshes.remove(stand_in.data)

    def finish(self):
        self.summary = bring(bpy.context, self.workshop.file(self.OUTPUT), f"{self.name} Regions", self.form)
        self.workshop.clear()
        self.told += self.job.notes


class CLOUDVDB_OT_bring_regions(Runs, bpy.types.Operator):
    """Makes objects to edit of the photon-cloud regions of the layout, or of the selected cloud's layout"""

    bl_idname = "cloudvdb.bring_regions"
    bl_label = "Regions as Objects"

    form: EnumProperty(name="As", items=AS, default="EMPTY", description="What regions become")

    def make(self, context):
        """The task of this button."""
        return RegionsTask(context, self.form)


class CLOUDVDB_OT_import_regions(bpy.types.Operator):
    """Reads the regions that cloudvdb wrote with -o regions.glb, as empties or metaballs"""

    bl_idname = "cloudvdb.import_regions"
    bl_label = "Import Cloud Regions"
    bl_options = {"REGISTER", "UNDO"}

    form: EnumProperty(name="As", items=AS, default="METABALL", description="What regions become")
    filepath: StringProperty(subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.glb;*.gltf", options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        try:
            said = bring(context, self.filepath, os.path.splitext(os.path.basename(self.filepath))[0], self.form)
        except CloudError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, said)
        return {"FINISHED"}


class CLOUDVDB_OT_show_layout(bpy.types.Operator):
    """Shows the active cloud's layout in renders again, and hides the cloud from them; or the other way about"""

    bl_idname = "cloudvdb.show_layout"
    bl_label = "Swap Layout and Cloud"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        good = context.object is not None and layout.is_cloud(context.object)
        if not good:
            cls.poll_message_set("Select a cloud that Synthesise Cloud made")
        return good

    def execute(self, context):
        cloud = context.object
        if cloud.hide_render:
            result.hide(cloud, [item.object for item in cloud.cloudvdb_record.layout if item.object])
        else:
            result.unhide(cloud)
        cloud.hide_render = not cloud.hide_render
        return {"FINISHED"}


CLASSES = (CLOUDVDB_OT_bring_regions, CLOUDVDB_OT_import_regions, CLOUDVDB_OT_show_layout)
register_classes, unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def menu(self, context):
    """File > Import."""
    self.layout.operator(CLOUDVDB_OT_import_regions.bl_idname, text="cloudvdb Regions (.glb)")


def register():
    register_classes()
    bpy.types.TOPBAR_MT_file_import.append(menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(menu)
    unregister_classes()
