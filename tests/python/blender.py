"""Runs a script in a Blender of its own, and brings back what it found.

Every script starts a new process, so that none inherits another's state, and the script lies in an empty folder:
beside a file named `cycles.py` Blender would lose its renderer. OpenVDB's Python module is never loaded there (bpy has
an OpenVDB of its own inside).
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import textwrap

import numpy as np

INSIDE = pathlib.Path(__file__).with_name("inside")

PRELUDE = f"""\
import json, sys
sys.path.insert(0, {str(INSIDE)!r})
from kit import *
given = json.load(open("given.json"))
out = {{}}
arrays = {{}}
"""

CODA = """
json.dump(out, open("out.json", "w"))
np.savez("arrays.npz", **arrays)
"""


def blender(script, timeout=300, python=None, prelude=PRELUDE, **given):
    """Runs `script`, which sees `given` and fills the dict `out`; arrays it fills come back as `out["arrays"]`. `python`
    is another interpreter, with another Blender; another prelude makes it no Blender at all."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "script.py").write_text(prelude + textwrap.dedent(script) + CODA)
        (folder / "given.json").write_text(json.dumps(given, default=str))
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "BLENDER"))}
        process = subprocess.run([python or sys.executable, "-I", "script.py"], cwd=folder, env=environment, timeout=timeout,
                                 stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if not (folder / "arrays.npz").exists():
            raise AssertionError(f"the script ended with {process.returncode}:\n{process.stdout[-4000:]}")
        out = json.loads((folder / "out.json").read_text())
        with np.load(folder / "arrays.npz") as arrays:
            out["arrays"] = dict(arrays)
        return out
