# SPDX-License-Identifier: GPL-3.0-or-later
"""What the layout's glTF says beyond Blender's exporter: metaballs, media, the sun's disc, the sky.

Blender's exporter finds `glTF2ExportUserExtension` by its name in the add-on's module and calls its hooks, for File > Export > glTF and
for `write` alike: there is one format.
"""
import math

import bpy

from . import media, metaballs
from .errors import CloudError

#: Our own properties, which Blender before 5.0 takes for custom properties.
PRIVATE = ("cloudvdb_settings", "cloudvdb_record")
#: The exporter's key for a node's light, and the lumens that it makes of a watt.
LIGHTS, LUMENS = "KHR_lights_punctual", 683.0
#: What is being written by `write`; `None` while the user exports.
_request = None


class Request:
    """Which objects are a cloud's layout, and what else goes into its file."""

    def __init__(self, scene, layout, settings, medium=None):
        self.layout = set(layout)
        self.sun = sun_of(scene)
        self.surroundings, self.lamps = settings.surroundings, settings.lamps
        #: What fills objects that do not say so, where neither the panel nor the scene does.
        self.medium = medium
        #: Those of the layout, and what instances of collections bring along.
        self.regions = set()

    def keeps(self, thing):
        """Whether an object outside the layout is written."""
        if thing is None or thing.hide_render and thing != self.sun:
            return False
        return thing == self.sun or (self.surroundings and thing.type == "MESH") or (self.lamps and is_lamp(thing))

    def prune(self, tree):
        """Takes everything else out of the exporter's tree; parents stay for their place."""
        def keep(uuid, inside):
            node = tree.nodes[uuid]
            thing = node.blender_object
            mine = inside or thing in self.layout
            if mine and thing is not None:
                self.regions.add(thing)
            passes = mine and (thing is None or thing.instance_type != "NONE")
            node.children = [child for child in node.children if keep(child, passes)]
            return bool(mine or self.keeps(thing) or node.children)

        tree.roots = [root for root in list(tree.roots) if keep(root, False)]


class glTF2ExportUserExtension:
    """The hooks that Blender's exporter calls."""

    def __init__(self):
        from io_scene_gltf2.io.com.gltf2_io_extensions import Extension
        self.Extension = Extension
        self.suns = {}

    def vtree_after_filter_hook(self, tree, export_settings):
        """Leaves in the file what a cloud needs."""
        if _request:
            _request.prune(tree)

    def gather_node_hook(self, node, thing, export_settings):
        """A node is there: metaballs and media go into it."""
        if getattr(thing, "bl_rna", None) is None or thing.bl_rna.identifier != "Object":
            return
        said = _said(thing)
        _extras(node, thing, _cast(thing, said) if _request else said)
        if thing.type == "LIGHT" and thing.data.type == "SUN":
            self.suns[id(node)] = thing.data.angle
        if thing.type == "LIGHT" and (thing.data.type == "SUN" or (_request and is_lamp(thing))):
            _shine(node, thing.data, export_settings)
        if thing.type == "META" and not (_request and thing not in _request.regions):
            value = metaballs.to_extension(thing, export_settings.get("gltf_yup", True))
            if value:
                node.extensions = {**(node.extensions or {}), metaballs.EXTENSION: self.Extension(metaballs.EXTENSION, value, False)}

    def gather_material_hook(self, material, blender_material, export_settings):
        """A material's medium goes along, whether or not custom properties are exported."""
        _extras(material, blender_material, _said(blender_material))

    def gather_scene_hook(self, scene, blender_scene, export_settings):
        """The scene is there: the medium, the detail, the sun's disc and the sky go into it; what it says itself stays."""
        said = _said(blender_scene)
        if said is not None:
            known = media.of_scene(blender_scene.cloudvdb_settings)
            if _request and _request.medium and blender_scene.cloudvdb_settings.medium == "AUTO":
                known["medium"] = {**_request.medium, **known.get("medium", {})}
            angle = next((self.suns[id(node)] for node in _walk(scene.nodes) if id(node) in self.suns), None)
            known.update({} if angle is None else {"sun_angle": angle})
            sky = media.sky(blender_scene.world)
            known.update({} if sky is None else {"sky": sky})
            said = {**known, **said}
        _extras(scene, blender_scene, said)


def _said(block):
    """The custom property `cloudvdb` as a dict, {} where there is none; `None` where it cannot be read."""
    value = block.get(media.KEY) if block is not None else None
    return {} if value is None else media.spec(value)


def _cast(thing, said):
    """What an object is in the cloud's file, `said` being what it says itself."""
    if thing in _request.regions:
        if said is not None and thing.type == "EMPTY" and thing.empty_display_type == "SPHERE" and thing.instance_type == "NONE":
            return {"shape": "sphere", "radius": thing.empty_display_size, **said}
        return said
    if thing == _request.sun:
        return {}
    if _request.keeps(thing) and is_lamp(thing):
        return {"lamp_radius": max(thing.data.shadow_soft_size, 1e-3)}
    surface = _request.keeps(thing) and (not said or said.get("shape") == "surface")
    return {"shape": "surface" if surface else "ignore"}


def _extras(element, block, said):
    """Sets the key `cloudvdb` of a glTF element, and takes our own properties out. What could not be read goes as it is."""
    extras = {key: value for key, value in (element.extras or {}).items() if key not in PRIVATE} if isinstance(element.extras, dict) else {}
    if said:
        extras[media.KEY] = said
    elif said is None:
        extras[media.KEY] = block[media.KEY]
    element.extras = extras or None


def _shine(node, lamp, export_settings):
    """Sets the intensity of a light's node, lux of a Sun, else candela: where a lamp has nodes the exporter takes their strength alone, in
    5.2 from every lamp."""
    strength, light = strength_of(lamp), getattr((node.extensions or {}).get(LIGHTS), "extension", {}).get("light")
    if strength is None or light is None:
        return
    lumens = LUMENS if export_settings.get("gltf_lighting_mode", "SPEC") == "SPEC" else 1.0
    around = 1.0 if lamp.type == "SUN" else 4.0 * math.pi
    light.extension["intensity"] = lumens * strength * 2.0 ** getattr(lamp, "exposure", 0.0) / around


def strength_of(lamp):
    """A light's strength as renders have it, W/m2 of a Sun, else W, before its exposure: its own, in Cycles times that of its nodes. `None` where other nodes
    than one Emission make it, or its size."""
    if not getattr(lamp, "normalize", True):
        return None
    if bpy.context.scene.render.engine != "CYCLES" or not lamp.use_nodes or not lamp.node_tree:
        return lamp.energy
    out = lamp.node_tree.get_output_node("CYCLES")
    links = out.inputs["Surface"].links if out else ()
    emission = links[0].from_node if links else None
    if emission is None or emission.type != "EMISSION" or emission.inputs["Strength"].is_linked:
        return None
    return lamp.energy * emission.inputs["Strength"].default_value


def _walk(nodes):
    for node in nodes:
        yield node
        yield from _walk(node.children or [])


def is_lamp(thing):
    """Whether an object is a point or a spot light."""
    return thing.type == "LIGHT" and thing.data.type in ("POINT", "SPOT")


def suns(scene):
    """The Suns that renders show."""
    return [thing for thing in scene.objects if thing.type == "LIGHT" and thing.data.type == "SUN" and not thing.hide_render]


def sun_of(scene):
    """The Sun that shines on clouds: the strongest; the first of equals."""
    return max(suns(scene), key=lambda thing: strength_of(thing.data) or thing.data.energy, default=None)


def write(path, request):
    """Writes the request's layout as .glb, by Blender's own exporter. Raises `CloudError`."""
    global _request
    if not hasattr(bpy.types, "EXPORT_SCENE_OT_gltf"):
        raise CloudError("Blender's add-on glTF 2.0 is not enabled, and layouts leave Blender by it: enable it in Edit > Preferences > Add-ons")
    wanted = {"export_format": "GLB", "export_extras": True, "export_lights": True, "export_cameras": False, "export_animations": False,
              "export_apply": True, "export_yup": True, "use_active_scene": True, "export_materials": "EXPORT", "export_image_format": "NONE",
              "export_texcoords": False, "export_normals": False, "export_skins": False, "export_morph": False, "use_selection": False,
              "use_visible": False, "use_renderable": False, "export_import_convert_lighting_mode": "SPEC", "export_gn_mesh": True,
              "export_current_frame": True}
    known = bpy.ops.export_scene.gltf.get_rna_type().properties
    _request = request
    try:
        bpy.ops.export_scene.gltf(filepath=path, **{key: value for key, value in wanted.items() if key in known})
    except RuntimeError as error:
        raise CloudError(f"Blender's glTF exporter failed: {str(error).strip().splitlines()[-1]}") from error
    finally:
        _request = None
