# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the add-on's zips: `python blender_addon/build.py --output out [--binary target/release/cloudvdb]`.

cloudvdb-VERSION.zip is the extension (Blender 4.2 and later), cloudvdb-VERSION-legacy.zip the add-on for 3.4 to 4.1: the same files, in
a folder there. `--binary` brings the command along. Blender's own `blender_ext.py` builds and validates the extension; it is found in
the Python module `bpy`, or named by `--blender-ext`.
"""
import argparse
import importlib.util
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
LEFT_OUT = shutil.ignore_patterns("__pycache__", "build.py", "*.zip", ".*")


def blender_ext():
    """Blender's tool for extensions, inside the module `bpy`."""
    spec = importlib.util.find_spec("bpy")
    found = list(pathlib.Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")) if spec else []
    if not found:
        sys.exit("blender_ext.py was not found: run this with a Python that has bpy 4.2 or later, or name it with --blender-ext")
    return found[0]


def run(tool, *arguments):
    """One command of Blender's tool; its words are shown where it fails."""
    done = subprocess.run([sys.executable, tool, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        sys.exit(f"{pathlib.Path(tool).name} {arguments[0]} failed:\n{done.stdout}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=pathlib.Path, default=HERE.parent / "out")
    parser.add_argument("--binary", type=pathlib.Path, help="the command to bring along")
    parser.add_argument("--blender-ext", type=pathlib.Path, help="Blender's blender_ext.py")
    arguments = parser.parse_args()
    tool = arguments.blender_ext or blender_ext()
    version = re.search(r'^version = "(.+)"', (HERE / "blender_manifest.toml").read_text(), re.MULTILINE).group(1)
    arguments.output.mkdir(parents=True, exist_ok=True)
    extension, legacy = (arguments.output.resolve() / f"cloudvdb-{version}{kind}.zip" for kind in ("", "-legacy"))
    with tempfile.TemporaryDirectory() as folder:
        package = pathlib.Path(folder) / "cloudvdb"
        shutil.copytree(HERE, package, ignore=LEFT_OUT)
        if arguments.binary:
            (package / "bin").mkdir()
            shutil.copy2(arguments.binary, package / "bin")
        run(tool, "build", "--source-dir", package, "--output-filepath", extension)
        shutil.make_archive(str(legacy.with_suffix("")), "zip", folder, "cloudvdb")
    run(tool, "validate", extension)
    print(extension, legacy, sep="\n")


if __name__ == "__main__":
    main()
