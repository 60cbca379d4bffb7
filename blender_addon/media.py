# SPDX-License-Identifier: GPL-3.0-or-later
"""The custom property `cloudvdb` as the command reads it: media, details, the sun's disc, the sky."""
import json

SHAPES = ("sphere", "metaball", "slab", "mesh", "surface", "vdb", "ignore")
PRESETS = ("cumulus", "stratus", "cirrus", "haze", "smoke", "milk", "hura2006")
KEY = "cloudvdb"


def spec(value):
    """The property's value as a dict; `None` where it is no such thing, so that the command can say so itself."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if isinstance(value, dict):
        return dict(value)
    if isinstance(value, str):
        word = value.strip()
        if word in SHAPES:
            return {"shape": word}
        if word in PRESETS:
            return {"preset": word}
        try:
            parsed = json.loads(word)
        except ValueError:
            return None
        return parsed if isinstance(parsed, dict) else None
    return None


def of_scene(settings):
    """What the panel says about every object that does not say its own: the keys `medium` and `detail`."""
    said = {}
    if settings.medium == "CUSTOM":
        said["medium"] = {"sigma_t": settings.sigma_t, "albedo": settings.albedo, "g": settings.anisotropy}
    elif settings.medium != "AUTO":
        said["medium"] = {"preset": settings.medium}
    if settings.detail == "none":
        said["detail"] = "none"
    elif settings.detail != "AUTO":
        said["detail"] = {"genus": settings.detail, "strength": settings.detail_strength, "octaves": settings.detail_octaves,
                          "seed": settings.detail_seed}
        if settings.detail_size > 0:
            said["detail"]["size"] = settings.detail_size
    return said


def sky(world):
    """The radiance of an even sky in W/m^2/sr as [r, g, b]; `None` where there is none, or textures make it."""
    if world is None:
        return None
    if not (world.use_nodes and world.node_tree):
        return list(world.color)
    outputs = [node for node in world.node_tree.nodes if node.type == "OUTPUT_WORLD"]
    active = next((node for node in outputs if node.is_active_output), outputs[0] if outputs else None)
    if active is None or not active.inputs["Surface"].is_linked:
        return None
    background = active.inputs["Surface"].links[0].from_node
    if background.type != "BACKGROUND" or any(socket.is_linked for socket in background.inputs):
        return None
    strength = background.inputs["Strength"].default_value
    return [channel * strength for channel in background.inputs["Color"].default_value[:3]]
