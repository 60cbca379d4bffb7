"""Writes tests/data/metaballs.json: families whose surface Blender made, for the tests that run without Blender.

    .venv/bin/python tests/python/metaball_families.py
"""
import json
import pathlib

from blender import blender

FAMILIES = """
import metaballs
out["families"] = [metaballs.family(seed) for seed in range(given["first"], given["first"] + given["count"])]
out["blender"] = bpy.app.version_string
"""


def families(first, count, **options):
    return blender(FAMILIES, first=first, count=count, **options)


def rounded(value):
    """Numbers to seven digits, which is what Blender has."""
    if isinstance(value, float):
        return float(f"{value:.7g}")
    if isinstance(value, list):
        return [rounded(v) for v in value]
    return {k: rounded(v) for k, v in value.items()} if isinstance(value, dict) else value


if __name__ == "__main__":
    found = families(0, 60)
    for one in found["families"]:
        del one["normals"]
    path = pathlib.Path(__file__).resolve().parents[1] / "data" / "metaballs.json"
    path.write_text(json.dumps({"blender": found["blender"], "families": rounded(found["families"])}, separators=(",", ":")) + "\n")
    print(f"{path}: {sum(len(one['vertices']) for one in found['families'])} vertices, {path.stat().st_size} bytes")
