"""Writes small VDBs byte by byte, in each compression, as no program does: the reader's tests need files that lie."""
import struct
import zlib

ZIP, MASK, BLOSC = 1, 2, 4


def text(s):
    s = s.encode()
    return struct.pack("<I", len(s)) + s


def metadata(entries):
    """Strings, truth values, whole and other numbers."""
    kinds = {str: ("string", str.encode), bool: ("bool", lambda v: bytes([v])), int: ("int64", lambda v: struct.pack("<q", v)),
             float: ("double", lambda v: struct.pack("<d", v))}
    out = struct.pack("<I", len(entries))
    for key, value in entries.items():
        kind, pack = kinds[type(value)]
        out += text(key) + text(kind) + struct.pack("<I", len(pack(value))) + pack(value)
    return out


def chunk(values, flags, stored=None):
    """A kind (inactive values are the background), a size, and the values; `stored` is a chunk to take in their place."""
    raw = struct.pack(f"<{len(values)}f", *values)
    if stored is None:
        packed = zlib.compress(raw) if flags & ZIP else raw
        if len(packed) < len(raw):
            stored = struct.pack("<q", len(packed)) + packed
        else:
            stored = (struct.pack("<q", -len(raw)) if flags & (ZIP | BLOSC) else b"") + raw
    return bytes([0 if flags & MASK else 6]) + stored


def mask(bits, on=()):
    out = bytearray(bits // 8)
    for i in on:
        out[i // 8] |= 1 << i % 8
    return bytes(out)


def node(side, children, flags, tiles=()):
    """An internal node of `side`^3 places: a child's bytes at each place of `children`, the value of a tile at each of `tiles`."""
    tiles = dict(tiles)
    values = [tiles[i] for i in sorted(tiles)] if flags & MASK else [tiles.get(i, 0.0) for i in range(side ** 3)]
    return mask(side ** 3, children) + mask(side ** 3, tiles) + chunk(values, flags) + b"".join(children[i] for i in sorted(children))


def vdb(flags=ZIP | MASK, leaves=None, tiles=(), upper_tiles=(), root_tiles=(), stored=None, voxel=0.5, entries=None, name="density", counts=None):
    """A file of one float grid: `leaves` by their place in the only lower node, each a dictionary of active samples."""
    leaves = {0: {i: 1.0 + i % 7 for i in range(0, 512, 3)}} if leaves is None else leaves
    masks = {at: mask(512, samples) for at, samples in leaves.items()}
    lower = node(16, masks, flags, tiles)
    upper = node(32, {0: lower}, flags, upper_tiles)
    root = struct.pack("<f", 0.0) + struct.pack("<II", *(counts or (len(root_tiles), 1)))
    root += b"".join(struct.pack("<3if?", *origin, value, True) for origin, value in root_tiles)
    topology = struct.pack("<i", 1) + root + struct.pack("<3i", 0, 0, 0) + upper
    buffers = b""
    for at in sorted(leaves):
        samples = leaves[at]
        values = [samples[i] for i in sorted(samples)] if flags & MASK else [samples.get(i, 0.0) for i in range(512)]
        buffers += masks[at] + chunk(values, flags, stored)
    scales = [v for each in (voxel, voxel, 1 / voxel, voxel ** -2, 0.5 / voxel) for v in [each] * 3]
    transform = text("UniformScaleMap") + struct.pack("<15d", *scales)
    about = metadata(entries or {"class": "fog volume"})
    head = struct.pack("<q3IB", 0x56444220, 224, 10, 0, 1) + b"01234567-89ab-8cde-af01-23456789abcd" + metadata({"creator": "a test"}) + struct.pack("<i", 1)
    head += text(name) + text("Tree_float_5_4_3") + text("")
    begin = len(head) + 24
    grid = struct.pack("<I", flags) + about + transform + topology
    return head + struct.pack("<3q", begin, begin + len(grid), begin + len(grid) + len(buffers)) + grid + buffers
