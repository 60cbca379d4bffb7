# SPDX-License-Identifier: GPL-3.0-or-later
"""A numbered sequence of clouds, frame by frame, that can be stopped and goes on where it was."""
import hashlib
import json
import os
import shutil

import bpy

from . import baking, binary, layout, output, result, takes, vdb_metadata
from .errors import CloudError
from .task import Task, describe, scene_of, settings_of


class Sequence(Task):
    """Frames of moving layouts: the same seed, voxel size and medium in all of them, so that nothing flickers."""

    def begin(self):
        scene, settings = scene_of(self.scene), settings_of(self.scene)
        if settings.frame_end < settings.frame_start:
            raise CloudError(f"The sequence ends at frame {settings.frame_end} before it starts at {settings.frame_start}: set End under Animation")
        self.frames, self.at, self.shown = range(settings.frame_start, settings.frame_end + 1), 0, scene.frame_current
        self.voxel_size, self.made = None, 0
        self.stem, self.fresh = self.last_stem(), False
        self.done = self.read()

    def cloud(self):
        """The layout's cloud, where there is one."""
        scene = scene_of(self.scene)
        return layout.existing(scene, self.things(scene))

    def last_stem(self):
        """The take to go on with: this cloud's own, or that of a run that was stopped before there was one; else a new one."""
        old = self.cloud()
        own = takes.stem_of(old.data.filepath) if old else os.path.join(self.folder, output.clean(self.name))
        if os.path.dirname(own) == self.folder and os.path.exists(f"{own}.frames.json"):
            return own
        return takes.next_stem(self.folder, self.name, self.cloud())

    def new_take(self):
        """A frame that Blender may have shown has changed: on with new names, under which the frames that are done come along."""
        old, self.stem, self.fresh = self.stem, takes.next_stem(self.folder, self.name, self.cloud()), True
        for frame in list(self.done):
            path = f"{old}.{int(frame):04}.vdb"
            try:
                os.link(path, self.path(int(frame)))
            except FileNotFoundError:
                del self.done[frame]
            except OSError:  # a file system without links
                shutil.copy2(path, self.path(int(frame)))

    def path(self, frame):
        """A frame's VDB: digits last, as Blender wants them."""
        return f"{self.stem}.{frame:04}.vdb"

    def read(self):
        """What each frame on disk was made of."""
        try:
            with open(f"{self.stem}.frames.json", encoding="utf-8") as file:
                return json.load(file)
        except (OSError, ValueError):
            return {}

    def fraction(self):
        return (self.at + (self.job.fraction() if self.job else 0.0)) / len(self.frames)

    def stage(self):
        return f"frame {self.frames[min(self.at, len(self.frames) - 1)]}"

    def advance(self):
        """Does the next step of the frame that is on; True after the last."""
        if self.job is None:
            self.enter(self.frames[self.at])
        elif self.job.running():
            return False
        else:
            self.keep(self.frames[self.at], self.job.report())
        if self.at < len(self.frames):
            return False
        self.finish()
        return True

    def enter(self, frame):
        """Exports a frame; starts the command, unless this very frame is on disk already."""
        scene, settings = scene_of(self.scene), settings_of(self.scene)
        scene.frame_set(frame)
        path = self.layout_file()
        with open(path, "rb") as file:
            words = [binary.version(self.command), *self.flags(settings, self.voxel_size)]
            self.print = hashlib.sha256(file.read() + "\0".join(words).encode()).hexdigest()
        entry = self.done.get(str(frame))
        if entry and entry["print"] == self.print and os.path.isfile(self.path(frame)):
            self.leave(frame, entry["report"])
        else:
            if not self.fresh and os.path.isfile(self.path(frame)):
                self.new_take()
            # Baked light is compared with the path tracer's in the first frame alone.
            unchecked = self.at > 0 and settings.bake != "none"
            self.start(settings, path, self.voxel_size, ["--no-check"] if unchecked else [])

    def keep(self, frame, report):
        """A frame is made: its file goes to its place, and into the list of what is done."""
        self.workshop.deliver(self.OUTPUT, self.path(frame))
        report = {key: report.get(key) for key in ("vdb", "regions", "seconds", "bake")}
        self.done[str(frame)] = {"print": self.print, "report": report}
        with open(self.workshop.file("frames.json"), "w", encoding="utf-8") as file:
            json.dump(self.done, file)
        self.workshop.deliver("frames.json", f"{self.stem}.frames.json")
        self.made += 1
        self.told += [note for note in self.job.notes if note not in self.told]
        self.leave(frame, report)

    def leave(self, frame, report):
        """On to the next frame; the first one's voxel size and medium hold for all."""
        if self.report is None:
            metadata = vdb_metadata.read(self.path(frame))
            self.report, self.voxel_size = report, report["vdb"]["voxel_size"]
            self.medium = {"sigma_t": report["vdb"]["density_scale"], "albedo": metadata["albedo"], "g": metadata["g"]}
        elif abs(report["vdb"]["density_scale"] / self.report["vdb"]["density_scale"] - 1) > 1e-3:
            self.told.append(f"Frame {frame} has Density {report['vdb']['density_scale']:.4g}, the first {self.report['vdb']['density_scale']:.4g}: "
                             "give the objects one medium")
        if not baking.alike(self.report, report):
            self.told.append(f"Frame {frame} has flames, or baked light, of other colours or phase functions than the first, whose material shows it: "
                             "let the lights keep their colours, and give the objects one medium")
        self.job, self.at = None, self.at + 1

    def history(self):
        """Of each frame its number, report and metadata, where the light of all can be shown by one material."""
        frames = [(frame, self.done[str(frame)]["report"], vdb_metadata.read(self.path(frame))) for frame in self.frames]
        return frames if all(baking.alike(self.report, report) for _, report, _ in frames) else []

    def finish(self):
        scene, settings = scene_of(self.scene), settings_of(self.scene)
        scene.frame_set(self.shown)
        self.workshop.clear()
        cloud, told = result.place(scene, self.things(scene), self.name, self.path(self.frames[0]), self.report, settings,
                                   frames=(self.frames[0], len(self.frames)), history=self.history())
        takes.wrote(self.stem)
        self.told += told
        self.summary = f'"{cloud.name}": {len(self.frames)} frames, {self.made} of them new; the first: {describe(self.report)}'

    def cancel(self):
        super().cancel()
        scene = bpy.data.scenes.get(self.scene)
        if scene and hasattr(self, "shown"):
            scene.frame_set(self.shown)
