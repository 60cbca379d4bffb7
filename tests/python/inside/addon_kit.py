"""What the add-on's checks share. Inside Blender only, after `kit`: the add-on is installed as a user would."""
import contextlib
import json
import os
import shutil
import sys
import traceback

import bpy
from kit import link
from mathutils import Vector

SEEN = {}


def install(path):
    """Installs a zip by Blender's own installer, enables it, and returns the add-on's module."""
    if bpy.app.version >= (4, 2, 0):
        bpy.ops.extensions.package_install_files(filepath=path, repo="user_default", enable_on_install=True)
        name = "bl_ext.user_default.cloudvdb"
    else:
        bpy.ops.preferences.addon_install(filepath=path)
        bpy.ops.preferences.addon_enable(module="cloudvdb")
        name = "cloudvdb"
    assert name in bpy.context.preferences.addons, list(bpy.context.preferences.addons.keys())
    return sys.modules[name]


def module():
    """The enabled add-on's module."""
    return next(sys.modules[name] for name in bpy.context.preferences.addons.keys() if name.split(".")[-1] == "cloudvdb")


def preferences():
    return bpy.context.preferences.addons[module().__name__].preferences


def fresh(folder=None, **settings):
    """An empty scene that keeps the add-on; saved as a .blend in `folder`. Small clouds, for speed."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    if folder:
        os.makedirs(folder, exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "scene.blend"))
        scene = bpy.context.scene
    own = scene.cloudvdb_settings
    own.photons, own.max_voxels = 10_000, 60_000
    for key, value in settings.items():
        setattr(own, key, value)
    return scene


def metaball(name="Mball", at=(0, 0, 0), radius=2.0, kind="BALL", co=(0, 0, 0)):
    data = bpy.data.metaballs.new(name)
    data.resolution = 0.3
    one = data.elements.new(type=kind)
    one.radius, one.co = radius, co
    return link(name, data, location=at)


def choose(*things):
    """Selects these and nothing else."""
    bpy.context.view_layer.update()
    for other in bpy.context.view_layer.objects:
        other.select_set(False)
    for thing in things:
        thing.select_set(True)
        bpy.context.view_layer.objects.active = thing


def press(operator="synthesise", **options):
    """Presses a button; returns the error's words where it failed, else nothing."""
    try:
        result = getattr(bpy.ops.cloudvdb, operator)(**options)
    except RuntimeError as error:
        return str(error)
    assert result == {"FINISHED"}, result
    return ""


def cloud(*things, **options):
    """Presses the button on these objects; returns the Volume."""
    choose(*things)
    before = set(bpy.data.objects)
    said = press(**options)
    assert not said, said
    made = [thing for thing in bpy.data.objects if thing not in before and thing.type == "VOLUME"]
    return made[0] if made else None


def message():
    return bpy.context.scene.cloudvdb_settings.message


def vdb(volume):
    return bpy.path.abspath(volume.data.filepath)


def shader(volume):
    return next(node for node in volume.data.materials[0].node_tree.nodes if node.type == "PRINCIPLED_VOLUME")


def files(folder):
    """All files and folders below, hidden ones too."""
    return sorted(os.path.relpath(os.path.join(root, name), folder) for root, folders, names in os.walk(folder) for name in names + folders)


def script(path, *lines):
    """A command that is no cloudvdb, or not quite."""
    with open(path, "w") as file:
        file.write("#!/bin/sh\n" + "\n".join(lines) + "\n")
    os.chmod(path, 0o755)
    return path


@contextlib.contextmanager
def command(path):
    """Another command in the preferences."""
    own = preferences()
    before, own.binary = own.binary, str(path)
    try:
        yield
    finally:
        own.binary = before


def middle(things):
    """The middle of the objects' bounds in the world."""
    bpy.context.view_layer.update()
    corners = [thing.matrix_world @ Vector(corner) for thing in things for corner in thing.bound_box]
    return [0.5 * (min(c[k] for c in corners) + max(c[k] for c in corners)) for k in range(3)]


def exported(path, **options):
    """The document of File > Export > glTF."""
    settings = dict(export_format="GLTF_SEPARATE", export_extras=True, export_lights=True, export_animations=False)
    settings.update(options)
    bpy.ops.export_scene.gltf(filepath=path, **settings)
    with open(path) as file:
        return json.load(file)


def run_checks(checks, folder, names=None):
    """Runs functions, each with a folder of its own; {name: "" or how it failed}."""
    out = {}
    for name, check in checks.items():
        if names and name not in names:
            continue
        own = os.path.join(folder, name)
        os.makedirs(own)
        try:
            check(own)
            out[name] = ""
        except Exception:
            out[name] = traceback.format_exc()
        finally:
            if not out.get(name):
                shutil.rmtree(own, ignore_errors=True)
    return out
