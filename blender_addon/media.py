# SPDX-License-Identifier: GPL-3.0-or-later
"""The custom property `cloudvdb` as the command reads it: media, details, the sun's disc, the sky."""
import json
import math

SHAPES = ("sphere", "metaball", "slab", "mesh", "surface", "vdb", "ignore")
PRESETS = ("cumulus", "stratus", "cirrus", "haze", "smoke", "hura2006", "milk", "skim_milk", "cream", "skin", "marble", "apple", "potato",
           "chicken", "ketchup")
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
    shines = {"emission": [settings.emission * channel for channel in settings.emission_color]} if settings.emission > 0 else {}
    shines.update({"temperature": settings.temperature} if settings.temperature > 0 else {})
    if shines:
        said["medium"] = {**said.get("medium", {}), **shines}
    if settings.detail == "none":
        said["detail"] = "none"
    elif settings.detail != "AUTO":
        said["detail"] = {"genus": settings.detail, "strength": settings.detail_strength, "octaves": settings.detail_octaves,
                          "seed": settings.detail_seed}
        if settings.detail_size > 0:
            said["detail"]["size"] = settings.detail_size
    return said


def sky(world):
    """The sky as the command reads it: the radiance of an even one in W/m^2/sr as [r, g, b], or an image of all directions; `None` where
    there is none, or something else makes it."""
    if world is None:
        return None
    if not (world.use_nodes and world.node_tree):
        return list(world.color)
    outputs = [node for node in world.node_tree.nodes if node.type == "OUTPUT_WORLD"]
    active = next((node for node in outputs if node.is_active_output), outputs[0] if outputs else None)
    if active is None or not active.inputs["Surface"].is_linked:
        return None
    background = active.inputs["Surface"].links[0].from_node
    if background.type != "BACKGROUND" or background.inputs["Strength"].is_linked:
        return None
    strength, color = background.inputs["Strength"].default_value, background.inputs["Color"]
    if color.is_linked:
        return _image(color.links[0].from_node, strength)
    return [channel * strength for channel in color.default_value[:3]]


def _image(node, strength):
    """An Environment Texture of an EXR or HDR file, turned about the vertical at most."""
    image = node.image if node.type == "TEX_ENVIRONMENT" and node.projection == "EQUIRECTANGULAR" else None
    path = image.filepath_from_user() if image else ""
    if not path.lower().endswith((".exr", ".hdr")):
        return None
    turn = 0.0
    if node.inputs["Vector"].is_linked:
        mapping = node.inputs["Vector"].links[0].from_node
        if mapping.type != "MAPPING" or mapping.vector_type != "POINT":
            return None
        where, angles, scale = (tuple(mapping.inputs[name].default_value) for name in ("Location", "Rotation", "Scale"))
        if any(where) or any(angles[:2]) or scale != (1.0, 1.0, 1.0):
            return None
        # It turns what is looked up, and so the picture the other way.
        turn = -math.degrees(angles[2])
    return {"image": path, "strength": strength, "turn": turn}
