# SPDX-License-Identifier: GPL-3.0-or-later
"""The metadata of an OpenVDB file, read from its first bytes: Blender shows it nowhere."""
import struct

MAGIC = b" BDV"
FORMATS = {"double": "<d", "float": "<f", "int32": "<i", "int64": "<q"}


def read(path):
    """The file's metadata as a dict: numbers and strings; other types are left out. Empty where it is no VDB."""
    with open(path, "rb") as file:
        head = file.read(16384)
    if head[:4] != MAGIC:
        return {}
    # Magic number, file version, library version, whether grids have offsets, UUID.
    at = 8 + 4 + 8 + 1 + 36

    def text():
        nonlocal at
        (length,) = struct.unpack_from("<I", head, at)
        at += 4 + length
        return head[at - length:at]

    (count,) = struct.unpack_from("<I", head, at)
    at += 4
    found = {}
    for _ in range(count):
        name, kind, value = text().decode(), text().decode(), text()
        if kind == "string":
            found[name] = value.decode("utf-8", "replace")
        elif kind in FORMATS:
            (found[name],) = struct.unpack(FORMATS[kind], value)
    return found
