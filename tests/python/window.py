"""Blender in a real window: Xvfb, software GL, real mouse and key events."""
import contextlib
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time

import pytest

from addon import INSIDE, zips
from command import binary

SIZE = (1280, 800)
NEEDED = ("blender", "Xvfb", "xdotool", "import")
PRELUDE = f"""\
import json, os, sys
sys.path.insert(0, {str(INSIDE)!r})
import bpy
from addon_kit import *
given = json.load(open("given.json"))
install(given["zip"])
preferences().binary = given["binary"]
bpy.context.preferences.view.show_splash = False
bpy.context.preferences.view.ui_scale = 1.0
from addon_window import *
"""


class Window:
    """A Blender on a screen of its own. `say` runs Python in it between two events; `press` and `key` are those of X11."""

    def __init__(self, folder, display, blender):
        self.folder, self.display, self.blender = folder, display, blender
        self.environment = dict(os.environ, DISPLAY=display)
        self.count = 0

    def say(self, script, timeout=60):
        """Runs a script in Blender's main loop; returns what it puts into `out`."""
        self.count += 1
        done = self.folder / f"{self.count}.json"
        waiting = self.folder / f"{self.count}.py.part"
        waiting.write_text(script)
        waiting.rename(self.folder / f"{self.count}.py")
        end = time.monotonic() + timeout
        while not done.exists():
            assert self.blender.poll() is None and time.monotonic() < end, (self.folder / "log").read_text()[-3000:]
            time.sleep(0.02)
        answer = json.loads(done.read_text())
        assert "error" not in answer, answer["error"]
        return answer

    def until(self, condition, timeout=60):
        """Waits until an expression is true in Blender; returns the seconds."""
        begin = time.monotonic()
        while not self.say(f"out['is'] = bool({condition})")["is"]:
            assert time.monotonic() - begin < timeout, condition
            time.sleep(0.05)
        return time.monotonic() - begin

    def settle(self, timeout=40):
        """Waits until all is drawn: software takes most of a second for a view, and smooths it over several drawings."""
        quick, end = 0, time.monotonic() + timeout
        while quick < 5:
            begin = time.monotonic()
            self.say("")
            quick = quick + 1 if time.monotonic() - begin < 0.1 else 0
            assert time.monotonic() < end, "it never comes to rest"

    def x(self, *arguments):
        subprocess.run(["xdotool", *map(str, arguments)], env=self.environment, check=True)

    def move(self, x, y):
        self.x("mousemove", x - 3, y)
        self.settle()
        self.x("mousemove", x, y)
        self.settle()

    def press(self, x, y):
        """A click of the left button."""
        self.move(x, y)
        self.x("mousedown", 1)
        time.sleep(0.1)
        self.x("mouseup", 1)

    def key(self, name):
        self.x("key", name)

    def shoot(self, path):
        subprocess.run(["import", "-window", "root", str(path)], env=self.environment, check=True)
        return path


@contextlib.contextmanager
def window():
    """A Blender of the distribution with the add-on, in a folder of its own. Skips where a tool is missing."""
    missing = [name for name in NEEDED if not shutil.which(name)]
    if missing:
        pytest.skip(f"no {', '.join(missing)} here (apt-get install blender xvfb xdotool imagemagick)")
    version = subprocess.run(["blender", "--version"], stdout=subprocess.PIPE, text=True).stdout.split()[1]
    legacy = tuple(map(int, version.split(".")[:2])) < (4, 2)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "given.json").write_text(json.dumps({"zip": str(zips()[legacy]), "binary": str(binary())}))
        (folder / "script.py").write_text(PRELUDE)
        reading, writing = os.pipe()
        server = subprocess.Popen(["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24"], pass_fds=[writing],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        blender = None
        try:
            os.close(writing)
            display = ":" + os.read(reading, 16).decode().strip()
            environment = dict(os.environ, DISPLAY=display, LIBGL_ALWAYS_SOFTWARE="1", BLENDER_USER_RESOURCES=str(folder / "home"), PWD=str(folder))
            with open(folder / "log", "w") as log:
                blender = subprocess.Popen(["blender", "--factory-startup", "-p", "0", "0", *map(str, SIZE), "-P", str(folder / "script.py")], cwd=folder,
                                           env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT)
            screen = Window(folder, display, blender)
            screen.settle()
            yield screen
        finally:
            os.close(reading)
            for process in (blender, server):
                if process:
                    process.kill()
                    process.wait()
