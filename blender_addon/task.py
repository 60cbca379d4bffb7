# SPDX-License-Identifier: GPL-3.0-or-later
"""Making one cloud: export, the command, the Volume. Objects are kept by name, for undo may free them in between."""
import bpy

from . import baking, binary, gltf_export, layout, output, result, takes
from .errors import CloudError
from .job import Job
from .preferences import preferences


def arguments(settings, voxel_size=None):
    """The command's flags for the panel's settings; `voxel_size` holds for all frames of a sequence."""
    flags = ["--density", settings.density, "--model", settings.model, "--placement", settings.placement, "--photons", str(settings.photons),
             "--seed", str(settings.seed), "--max-voxels", str(settings.max_voxels), "--mesh-volumes"]
    size = voxel_size or (settings.voxel_size if settings.resolution == "SIZE" else None)
    if size:
        flags += ["--voxel-size", f"{size:.9g}"]
    return flags


class Task:
    """One cloud on its way. `advance` does what is next; when it returns True all is in place, and `told` and `summary` say what
    became of it. `cancel` may come at any time."""

    #: What the command writes.
    OUTPUT = "cloud.vdb"

    def __init__(self, context):
        settings = context.scene.cloudvdb_settings
        self.command = binary.check(preferences(context))
        things = layout.objects(context, settings)
        self.scene, self.layout = context.scene.name, [thing.name_full for thing in things]
        old = layout.existing(context.scene, things)
        self.name = old.name if old else free_name(layout.name_of(things))
        self.folder, note = self.output_folder(settings)
        self.told = [note] if note else []
        found = gltf_export.suns(context.scene)
        if len(found) > 1:
            self.told.append(f'Of {len(found)} Suns only the strongest, "{gltf_export.sun_of(context.scene).name}", shines on the cloud')
        self.job, self.summary, self.report = None, "", None
        #: The medium of every frame of a sequence, found in its first.
        self.medium = None
        self.workshop = output.Workshop(self.folder)
        try:
            self.begin()
        except BaseException:
            self.cancel()
            raise

    def output_folder(self, settings):
        """Where the files go, and a sentence where they will not stay there."""
        return output.folder_of(settings)

    def begin(self):
        """Exports, and starts the command."""
        self.start(settings_of(self.scene), self.layout_file())

    def layout_file(self):
        """Exports the layout as it is now."""
        scene = scene_of(self.scene)
        if bpy.context.scene != scene:
            raise CloudError(f'The window shows another scene: go back to "{self.scene}", whose layout is being exported')
        path = self.workshop.file("layout.glb")
        gltf_export.write(path, gltf_export.Request(scene, self.things(scene), scene.cloudvdb_settings, self.medium))
        return path

    def flags(self, settings, voxel_size=None):
        """The command's flags; light is baked into VDBs alone."""
        return arguments(settings, voxel_size) + (baking.flags(settings) if self.OUTPUT.endswith(".vdb") else [])

    def start(self, settings, path, voxel_size=None, more=()):
        """Starts the command on an exported layout, with `more` flags that change nothing in its VDB."""
        self.job = Job([self.command, path, "-o", self.workshop.file(self.OUTPUT), "--json", "--progress", "json",
                        *self.flags(settings, voxel_size), *more, "--overwrite"])

    def fraction(self):
        """How far it is, 0 to 1."""
        return self.job.fraction() if self.job else 0.0

    def stage(self):
        """What it does, in a word or two."""
        return self.job.stage if self.job else "export"

    def advance(self):
        """Looks whether the command has ended, and puts its cloud into the scene. Raises `CloudError`."""
        if self.job.running():
            return False
        self.report = self.job.report()
        self.finish()
        return True

    def finish(self):
        """Moves the files to their places and the Volume into the scene."""
        scene, settings = scene_of(self.scene), settings_of(self.scene)
        things = self.things(scene)
        old = layout.existing(scene, things)
        stem = takes.next_stem(self.folder, self.name, old)
        self.workshop.deliver(self.OUTPUT, stem + ".vdb")
        self.workshop.clear()
        cloud, told = result.place(scene, things, self.name, stem + ".vdb", self.report, settings)
        takes.wrote(stem)
        self.told += told + self.job.notes
        self.summary = f'"{cloud.name}": {describe(self.report)}'

    def things(self, scene):
        """The layout's objects, as far as they are still there."""
        wanted = set(self.layout)
        return [thing for thing in scene.objects if thing.name_full in wanted]

    def cancel(self):
        """Stops the command, and leaves no file."""
        if self.job:
            self.job.cancel()
        self.workshop.clear()


def describe(report):
    """The report in a line."""
    regions, vdb = report["regions"], report["vdb"]
    voxels = sum(grid["active_voxels"] for grid in vdb["grids"])
    made = f"{regions['synthesised']} regions from {regions['source']}" if regions["synthesised"] else f"{regions['source']} regions as sketched"
    return f"{made}, {voxels:,} voxels of {vdb['voxel_size']:.4g} m, Density {vdb['density_scale']:.4g}, {report['seconds']:.1f} s{baking.quality(report)}"


def scene_of(name):
    """The scene that the task began in. Raises `CloudError` where it has gone."""
    scene = bpy.data.scenes.get(name)
    if scene is None:
        raise CloudError(f'The scene "{name}" has gone, and with it the place for the cloud')
    return scene


def settings_of(name):
    """The settings of a scene by its name."""
    return scene_of(name).cloudvdb_settings


def free_name(name):
    """A name that no object has, without a number that would make a family of metaballs or a sequence of files."""
    found, number = name, 1
    while found in bpy.data.objects:
        number += 1
        found = f"{name} {number}"
    return found
