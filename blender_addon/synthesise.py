# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons that make clouds: they never block a window, and run to the end where there is none."""
import time

import bpy

from . import layout
from .errors import CloudError
from .sequence import Sequence
from .task import Task

#: The run that is on, for the panel and for whoever wants to stop it.
running = None
_stop = False


class Runs:
    """What both buttons share: a modal operator with a timer around a task."""

    #: One undo step for all of it; no redo panel, which would run it again at each change.
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        reason = "A cloud is on its way: wait, or press Esc" if running else layout.missing(context, context.scene.cloudvdb_settings)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def invoke(self, context, event):
        """The button: starts, and returns at once."""
        global running, _stop
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            task = self.make(context)
        except CloudError as error:
            return self.fail(context, error)
        running, _stop = task, False
        self.timer = context.window_manager.event_timer_add(0.05, window=context.window)
        self.told = None
        context.window_manager.modal_handler_add(self)
        self.show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Esc stops; the timer looks how far it is; everything else goes where it would."""
        if event.type == "ESC" and event.value == "PRESS" or _stop:
            self.cancel(context)
            self.report({"WARNING"}, "Cancelled: no cloud was made")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            done = running.advance()
        except CloudError as error:
            self.cancel(context)
            return self.fail(context, error)
        except Exception:
            self.cancel(context)
            raise
        if not done:
            self.show(context)
            return {"PASS_THROUGH"}
        task = running
        self.clean(context)
        return self.succeed(context, task)

    def cancel(self, context):
        """Blender calls this too, when a window closes or another file is opened."""
        if running:
            running.cancel()
        self.clean(context)

    def execute(self, context):
        """From a script, or without a window: to the end."""
        task = None
        try:
            task = self.make(context)
            while not task.advance():
                time.sleep(0.01)
        except CloudError as error:
            if task:
                task.cancel()
            return self.fail(context, error)
        except BaseException:
            if task:
                task.cancel()
            raise
        return self.succeed(context, task)

    def fail(self, context, error):
        """The command's sentence, as Blender reports errors."""
        context.scene.cloudvdb_settings.message = str(error)
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}

    def succeed(self, context, task):
        """What was made, and what the user should know."""
        context.scene.cloudvdb_settings.message = "\n".join([task.summary, *task.told])
        for note in task.told:
            self.report({"INFO"}, note)
        self.report({"INFO"}, task.summary)
        return {"FINISHED"}

    def show(self, context):
        """Progress in the status bar and the panel."""
        text = f"Cloud: {running.stage()}, {100 * running.fraction():.0f} %"
        if text != self.told:
            self.told = text
            context.workspace.status_text_set(f"{text}    Esc: Cancel")
            redraw(context)

    def clean(self, context):
        """Takes timer and texts away."""
        global running, _stop
        running, _stop = None, False
        context.window_manager.event_timer_remove(self.timer)
        if context.workspace:
            context.workspace.status_text_set(None)
        redraw(context)
        # Panels find their new heights in the first drawing, and their places in the second.
        bpy.app.timers.register(lambda: redraw(bpy.context), first_interval=0.3)


class CLOUDVDB_OT_synthesise(Runs, bpy.types.Operator):
    """Traces photons through the layout and makes a volume of it. A second press replaces the cloud; its transforms and material stay"""

    bl_idname = "cloudvdb.synthesise"
    bl_label = "Synthesise Cloud"

    def make(self, context):
        """The task of this button."""
        return Task(context)


class CLOUDVDB_OT_synthesise_sequence(Runs, bpy.types.Operator):
    """Makes a cloud of every frame, with one seed, and loads them as a sequence. Frames that are done are kept"""

    bl_idname = "cloudvdb.synthesise_sequence"
    bl_label = "Synthesise Sequence"

    def make(self, context):
        """The task of this button."""
        return Sequence(context)


class CLOUDVDB_OT_cancel(bpy.types.Operator):
    """Stops the cloud that is on its way. Nothing is left of it"""

    bl_idname = "cloudvdb.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context):
        return running is not None

    def execute(self, context):
        global _stop
        _stop = True
        return {"FINISHED"}


def redraw(context):
    """Draws the panels again, and not what is beside them: a viewport may take long."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


CLASSES = (CLOUDVDB_OT_synthesise, CLOUDVDB_OT_synthesise_sequence, CLOUDVDB_OT_cancel)
register_classes, unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def register():
    register_classes()


def unregister():
    global running
    if running:
        running.cancel()
        running = None
    unregister_classes()
