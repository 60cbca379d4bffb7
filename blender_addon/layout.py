# SPDX-License-Identifier: GPL-3.0-or-later
"""What a cloud is made of: the objects that the selection or a collection means."""
from . import metaballs
from .errors import CloudError

#: Kinds of objects that can be a cloud's layout.
KINDS = {"META", "MESH", "EMPTY", "CURVE", "SURFACE", "FONT"}
WANTED = "metaballs, spheres, closed meshes or sphere empties"


def is_cloud(thing):
    """Whether the object is a Volume that this add-on made."""
    return thing.type == "VOLUME" and thing.cloudvdb_record.made


def objects(context, settings):
    """The layout's objects, families of metaballs whole. Raises `CloudError` where there are none."""
    scene = context.scene
    if settings.source == "COLLECTION":
        collection = settings.collection
        if collection is None:
            raise CloudError("No collection is chosen: pick one in the panel Cloud, or switch to Selection")
        asked = [thing for thing in collection.all_objects if thing.visible_get(view_layer=context.view_layer)]
        where = f'The collection "{collection.name}"'
    else:
        asked, where = list(context.selected_objects), "The selection"
    found = []
    for thing in asked:
        if is_cloud(thing):
            found += [item.object for item in thing.cloudvdb_record.layout if item.object and item.object.name in scene.objects]
        elif thing.type == "META":
            found += metaballs.members(thing, scene)
        elif thing.type in KINDS:
            found.append(thing)
    found = list(dict.fromkeys(found))
    if not found:
        raise CloudError(f"{where} holds nothing that can be a cloud: {'choose' if asked else 'select'} {WANTED}")
    return found


def missing(context, settings):
    """Why there is no layout, in words for a button's tooltip; empty where there is one. Cheap: drawn often."""
    if context.mode != "OBJECT":
        return "Leave Edit Mode first (Tab)"
    if settings.source == "COLLECTION":
        return "" if settings.collection else "Pick the layout's collection in the panel Cloud"
    if any(thing.type in KINDS or thing.type == "VOLUME" for thing in context.selected_objects):
        return ""
    return f"Select {WANTED}, or a cloud made of them"


def name_of(things):
    """The name of the cloud that these objects make: after the one whose name comes first."""
    return metaballs.family(min(thing.name for thing in things)) + " Cloud"


def existing(scene, things):
    """The cloud that was made of most of these objects; `None` where there is none."""
    wanted = set(things)
    best, most = None, 0
    for thing in scene.objects:
        if is_cloud(thing):
            shared = sum(item.object in wanted for item in thing.cloudvdb_record.layout)
            if shared > most:
                best, most = thing, shared
    return best
