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
#: Seconds that the command has to end by itself once it is asked to.
GRACE = 0.3
#: How far the command stands back behind Blender and its drawing, as `nice` has it.
NICE = 10


class Job:
    """Starts `command` at once. Its JSON lines are read by threads, so that its pipes never fill."""

    def __init__(self, command):
        self.stage, self.share, self.notes = "import", 0.0, []
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
        """How far the whole run is, 0 to 1, over all stages."""
        before = 0.0
        for name, weight in STAGES.items():
            if name == self.stage:
                return min(before + weight * self.share, 1.0)
            before += weight
        return before

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
                self.stage, self.share = event["stage"], float(event["fraction"])
            elif kind == "error":
                self._error = event["message"]
            elif kind == "done":
                self.notes = event["notes"]

    def _read_data(self):
        self._out = self.process.stdout.read()
