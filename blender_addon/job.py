# SPDX-License-Identifier: GPL-3.0-or-later
"""One run of the command: a process, its progress, its end. Knows nothing of Blender."""
import contextlib
import json
import os
import subprocess
import threading

from .errors import CloudError

#: The command's stages in their order, and what share of the time each takes, roughly.
STAGES = {"import": 0.05, "photons": 0.30, "regions": 0.15, "voxels": 0.40, "vdb": 0.10}
#: The same where light is baked: it is followed in rounds of photons and smoothing, and its pictures are judged by others.
BAKING = {"import": 0.02, "photons": 0.08, "regions": 0.05, "light": 0.35, "voxels": 0.10, "bake": 0.10, "render": 0.25, "vdb": 0.05}
#: Stages that come again and again, nobody knows how often: each round goes half of the way that is left.
ROUNDS = ("light", "render")
#: Seconds that the command has to end by itself once it is asked to.
GRACE = 0.3
#: How far the command stands back behind Blender and its drawing, as `nice` has it.
NICE = 10


class Job:
    """Starts `command` at once. Its JSON lines are read by threads, so that its pipes never fill."""

    def __init__(self, command):
        self.stage, self.notes = "import", []
        self._weights, self._rounds, self._reached = BAKING if "--bake" in command else STAGES, {}, 0.0
        self._traces = "--bake" in command or "duality" in command
        self._error, self._said, self._out = None, [], b""
        if os.name == "nt":
            options = {"creationflags": subprocess.CREATE_NO_WINDOW | subprocess.BELOW_NORMAL_PRIORITY_CLASS}
        else:
            options = {"start_new_session": True}
        try:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)
        except OSError as error:
            raise CloudError(f"{command[0]} does not run ({error.strerror})") from error
        if hasattr(os, "setpriority"):
            # Blender comes first: it is where the user is.
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, self.process.pid, NICE)
        self._threads = [threading.Thread(target=read, daemon=True) for read in (self._read_words, self._read_data)]
        for thread in self._threads:
            thread.start()

    def running(self):
        """Whether the process is still at work."""
        return self.process.poll() is None

    def fraction(self):
        """How far the whole run is, 0 to 1, over all stages; it never goes back."""
        return self._reached

    def _enter(self, stage, share):
        """The command is at `share` of a stage."""
        if stage == "photons" and stage in self._rounds and self.stage != stage:
            stage = "light"
        if share == 0.0:
            self._rounds[stage] = self._rounds.get(stage, -1) + 1
        self.stage, names = stage, list(self._weights)
        # Metaballs become voxels before photons see them: that is no stage of the cloud's.
        early = stage == "voxels" and self._traces and "photons" not in self._rounds
        if stage in names and not early:
            if stage in ROUNDS:
                share = 1.0 - (1.0 - 0.5 * share) * 0.5 ** self._rounds.get(stage, 0)
            before = sum(self._weights[name] for name in names[:names.index(stage)])
            self._reached = max(self._reached, min(before + self._weights[stage] * share, 1.0))

    def cancel(self):
        """Ends the process within half a second, whatever it does."""
        if self.running():
            self.process.terminate()
            try:
                self.process.wait(GRACE)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self._join()

    def wait(self):
        """Waits for the end."""
        self.process.wait()

    def report(self):
        """The command's report, once it has ended. Raises `CloudError` with the command's own sentence where it failed."""
        code = self.process.wait()
        self._join()
        if code:
            said = " ".join(self._said)[-400:]
            signal = f"it was ended by signal {-code}" if code < 0 else f"exit code {code}"
            raise CloudError(self._error or f"cloudvdb failed: {said or signal}")
        try:
            return json.loads(self._out)
        except ValueError as error:
            raise CloudError(f"cloudvdb ended without a report ({error}); is it of another version?") from error

    def _join(self):
        for thread in self._threads:
            thread.join(1.0)
        for pipe in (self.process.stdout, self.process.stderr):
            pipe.close()

    def _read_words(self):
        for line in self.process.stderr:
            text = line.decode("utf-8", "replace").strip()
            try:
                event = json.loads(text)
                kind = event["event"]
            except (ValueError, TypeError, KeyError):
                self._said += [text] if text else []
                continue
            if kind == "progress":
                self._enter(event["stage"], float(event["fraction"]))
            elif kind == "error":
                self._error = event["message"]
            elif kind == "done":
                self.notes = event["notes"]

    def _read_data(self):
        self._out = self.process.stdout.read()
