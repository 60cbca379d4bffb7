"""The add-on's checks: functions of a folder, run in one Blender by test_addon.py. Inside Blender only."""
import json
import math
import os
import time

import bpy
from addon_kit import (choose, cloud, command, exported, files, fresh, link, message, metaball, middle, module, preferences, press, script, shader,
                       vdb)
from kit import camera, ico, render, sky, sun
from mathutils import Matrix

CHECKS = {}


def check(function):
    CHECKS[function.__name__] = function
    return function


# The button.

@check
def select_a_metaball_press_the_button_see_a_cloud(folder):
    scene = fresh(folder)
    ball = metaball(at=(1, 2, 3))
    assert scene.cycles.volume_bounces == 0
    volume = cloud(ball)
    assert volume.name == "Mball Cloud" and volume.data.filepath == "//clouds/Mball Cloud.vdb" and os.path.isfile(vdb(volume))
    assert [c.name for c in volume.users_collection] == ["Clouds"]
    assert ball.hide_render and ball.display_type == "BOUNDS" and ball.select_get()
    assert (scene.cycles.volume_bounces, scene.cycles.max_bounces) == (64, 64) and "Volume 0 -> 64" in message()
    assert [g.name for g in volume.data.grids] == ["density"]
    assert max(abs(a - b) for a, b in zip(middle([volume]), (1, 2, 3))) < 0.25, middle([volume])
    assert files(os.path.join(folder, "clouds")) == ["Mball Cloud.vdb"]


@check
def the_material_holds_the_reports_medium(folder):
    scene = fresh(folder, medium="CUSTOM", sigma_t=3.0, albedo=0.9, anisotropy=0.5, density="source")
    volume = cloud(metaball())
    node = shader(volume)
    assert abs(node.inputs["Density"].default_value - 3.0) < 1e-5 and "Density 3" in message()
    assert abs(node.inputs["Color"].default_value[0] - 0.9) < 1e-6 and abs(node.inputs["Anisotropy"].default_value - 0.5) < 1e-6
    assert node.inputs["Density Attribute"].default_value == "density" and 1.5 < volume.data.display.density <= 3
    scene.cloudvdb_settings.medium = "smoke"
    cloud(bpy.data.objects["Mball"])
    assert abs(node.inputs["Density"].default_value - 1.0) < 1e-5 and abs(node.inputs["Color"].default_value[0] - 0.6) < 1e-5


@check
def spheres_meshes_and_empties_make_clouds_too(folder):
    fresh(folder, density="source", medium="smoke")
    bpy.ops.mesh.primitive_cube_add(size=2, location=(8, 0, 0))
    empty = link("Puff", None, location=(-8, 0, 0), empty_display_type="SPHERE", empty_display_size=1.5)
    volume = cloud(ico("Ball"), bpy.data.objects["Cube"], empty)
    assert "3 regions as sketched" in message(), message()
    # Blender bounds grids by blocks of eight voxels.
    assert max(abs(a - b) for a, b in zip(middle([volume]), (-0.25, 0, 0))) < 0.7, middle([volume])


@check
def what_is_not_selected_takes_no_part(folder):
    scene = fresh(folder, density="source", medium="smoke")
    ball, other = ico("Ball"), ico("Other", at=(5, 0, 0))
    other["cloudvdb"] = "sphere"
    cloud(ball)
    assert "1 regions as sketched" in message(), message()
    scene.cloudvdb_settings.surroundings = True
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -2))
    cloud(ball)
    assert "1 regions as sketched" in message(), message()


@check
def it_lies_where_its_layout_is(folder):
    """Cycles judges: the absorbing cloud's centroid before a white sky, from two sides."""
    import numpy as np
    fresh(folder, density="source", medium="CUSTOM", sigma_t=0.3, albedo=0.0, anisotropy=0.0, resolution="SIZE", voxel_size=0.12, max_voxels=100_000)
    volume = cloud(ico("Ball", at=(1, 2, 3), subdivisions=4))
    sky(1.0)
    lens = camera(ortho=3.0)
    for axis, turn in (((0, -10, 0), (math.pi / 2, 0, 0)), ((10, 0, 0), (math.pi / 2, 0, math.pi / 2))):
        lens.location, lens.rotation_euler = [a + b for a, b in zip((1, 2, 3), axis)], turn
        lens.data.clip_start, lens.data.clip_end = 0.1, 100
        bpy.context.view_layer.update()
        depth = -np.log(np.maximum(render(48, 48, 16), 1e-6))
        rows, columns = np.mgrid[0:48, 0:48]
        off = [((where * depth).sum() / depth.sum() - 23.5) * 3.0 / 48 for where in (rows, columns)]
        assert max(map(abs, off)) < 0.1 * 0.12, (axis, off, volume.location[:])


@check
def cycles_renders_it_bright(folder):
    scene = fresh(folder)
    volume = cloud(metaball())
    sun(toward=(1, -1, 2)); camera(at=(0, -8, 0)); sky(0.0)
    image = render(32, 24, 4, bounces=scene.cycles.volume_bounces)
    assert volume.visible_get() and 0.02 < (image > 0.05).mean() < 0.9 and 0.05 < image[image > 0.05].mean() < 2, image.mean()


@check
def each_flag_is_one_that_the_command_takes(folder):
    scene = fresh(folder)
    ball = metaball()
    own = scene.cloudvdb_settings
    for name in ("density", "model", "placement", "medium", "detail"):
        for item in own.bl_rna.properties[name].enum_items:
            if item.identifier in ("cirrus", "haze") or "centimetres" in item.description:
                continue  # too dense or too thin for this ball; their names are the command's own all the same
            before = getattr(own, name)
            setattr(own, name, item.identifier)
            own.resolution, own.voxel_size = "SIZE", 0.2
            choose(ball)
            said = press()
            assert not said, (name, item.identifier, said)
            setattr(own, name, before)


@check
def a_second_press_replaces_the_cloud_and_keeps_what_is_the_users(folder):
    scene = fresh(folder, density="source", medium="smoke")
    ball = metaball()
    volume = cloud(ball)
    node, first = shader(volume), vdb(volume)
    volume.matrix_world = Matrix.Translation((10, 0, 0)) @ volume.matrix_world
    node.inputs["Density"].default_value, node.inputs["Emission Strength"].default_value = 7.0, 0.25
    volume.data.materials[0].name = "Mine"
    dimensions = volume.dimensions.copy()
    ball.data.elements[0].radius = 3.0
    own = scene.cloudvdb_settings
    own.resolution, own.voxel_size = "SIZE", 0.3
    assert cloud(ball) is None, "a second cloud"
    bpy.context.view_layer.update()
    assert [c.name for c in bpy.data.objects if c.type == "VOLUME"] == ["Mball Cloud"] and vdb(volume) != first
    assert volume.data.materials[0].name == "Mine" and node.inputs["Density"].default_value == 7.0 and node.inputs["Emission Strength"].default_value == 0.25
    assert volume.dimensions.x > 1.3 * dimensions.x, (volume.dimensions[:], dimensions[:])
    assert max(abs(a - b) for a, b in zip(middle([volume]), (10, 0, 0))) < 0.35, middle([volume])
    # Of a medium that changes the user's Density stays, and is told of; what is not the user's follows.
    own.medium = "hura2006"
    own.sigma_t = 2
    own.medium = "CUSTOM"
    cloud(ball)
    assert node.inputs["Density"].default_value == 7.0 and "is yours" in message() and abs(node.inputs["Anisotropy"].default_value - 0.86) < 1e-6
    # The cloud itself stands for its layout.
    assert cloud(volume) is None
    # A material that is none of ours.
    volume.data.materials[0] = bpy.data.materials.new("Bare")
    assert cloud(ball) is None and volume.data.materials[0].name == "Bare" and "no Principled Volume" in message()


@check
def two_clouds_do_not_meet(folder):
    fresh(folder, medium="smoke")
    one, two = metaball("One"), metaball("Two", at=(9, 0, 0))
    first, second = cloud(one), cloud(two)
    assert {first.name, second.name} == {"One Cloud", "Two Cloud"} and vdb(first) != vdb(second)
    before = os.stat(vdb(second)).st_mtime_ns
    cloud(one)
    assert os.stat(vdb(second)).st_mtime_ns == before and len([c for c in bpy.data.objects if c.type == "VOLUME"]) == 2


@check
def anothers_file_is_not_overwritten(folder):
    fresh(folder)
    os.makedirs(os.path.join(folder, "clouds"))
    theirs = os.path.join(folder, "clouds", "Mball Cloud.vdb")
    with open(theirs, "w") as file:
        file.write("another's")
    volume = cloud(metaball())
    assert os.path.basename(vdb(volume)) == "Mball Cloud 2.vdb" and open(theirs).read() == "another's"


@check
def names_of_all_kinds(folder):
    for name in ("Wolke \u00fc \u96f2", "a/b: c*?", "  ..", "Cloud.001"):
        fresh(os.path.join(folder, "ordner \u00e4 \u96f2"))
        volume = cloud(metaball(name))
        assert os.path.isfile(vdb(volume)) and [g.name for g in volume.data.grids] == ["density"], (name, vdb(volume))


@check
def takes_that_nothing_shows_are_removed(folder):
    fresh(folder, density="source", medium="smoke")
    ball, where = metaball(), os.path.join(folder, "clouds")
    names = [f"Mball Cloud{end}.vdb" for end in ("", " 2", " 3", " 4", " 5", " 6", " 7")]
    for number in range(7):
        cloud(ball)
        if number == 1:
            bpy.ops.wm.save_mainfile()
    # What the saved file shows, the last, and three to go back to.
    assert files(where) == sorted([names[1], *names[3:]]), files(where)


# The layout.

@check
def a_family_is_one_field_hidden_members_too(folder):
    scene = fresh(folder, density="source", medium="smoke")
    one, two, other = metaball("Ball"), metaball("Ball.001", at=(2, 0, 0)), metaball("Other", at=(0, 9, 0))
    two.hide_set(True)
    choose(one)
    volume = cloud(one)
    with open(vdb(volume), "rb") as file:
        alone = file.read()
    assert abs(middle([volume])[0] - 1) < 0.3, middle([volume])
    two.hide_set(False)
    cloud(two)
    with open(vdb(volume), "rb") as file:
        assert file.read() == alone
    assert not other.hide_render and scene.objects["Ball.001"].hide_render
    # An element that Blender hides is none.
    two.data.elements[0].hide = True
    cloud(one)
    assert abs(middle([volume])[0]) < 0.3, middle([volume])


@check
def a_collection_as_far_as_it_is_visible(folder):
    scene = fresh(folder, density="source", medium="smoke", source="COLLECTION")
    balls = [ico(f"Puff {i}", at=(3 * i, 0, 0)) for i in range(3)]
    group = bpy.data.collections.new("Group")
    scene.collection.children.link(group)
    for ball in balls:
        scene.collection.objects.unlink(ball)
        group.objects.link(ball)
    assert not bpy.ops.cloudvdb.synthesise.poll()
    scene.cloudvdb_settings.collection = group
    balls[2].hide_set(True)
    choose()
    assert not press() and "2 regions" in message(), message()
    # A second press: what the first one hid from renders is still its layout.
    assert not press() and "2 regions" in message(), message()


@check
def linked_data_libraries_and_instances(folder):
    fresh(folder)
    ball = metaball("Shared")
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "library.blend"))
    fresh(os.path.join(folder, "user"), density="source", medium="smoke")
    with bpy.data.libraries.load(os.path.join(folder, "library.blend"), link=True) as (source, target):
        target.objects = ["Shared"]
    linked = target.objects[0]
    bpy.context.scene.collection.objects.link(linked)
    volume = cloud(linked)
    assert "1 regions" in message() and volume.name == "Shared Cloud"
    ball = ico("Twin")
    twin = link("Twin other", ball.data, location=(5, 0, 0))
    cloud(ball, twin)
    assert "2 regions" in message()
    puffs = bpy.data.collections.new("Puffs")
    one = ico("Puff", at=(0, 0, 0))
    bpy.context.scene.collection.objects.unlink(one)
    puffs.objects.link(one)
    empties = [link(f"Instance {i}", None, location=(0, 6 + 3 * i, 0), instance_type="COLLECTION", instance_collection=puffs) for i in range(2)]
    volume = cloud(*empties)
    assert "2 regions" in message() and abs(middle([volume])[1] - 7.5) < 0.2, (message(), middle([volume]))


@check
def nothing_selected_is_no_button(folder):
    fresh(folder)
    sun()
    choose()
    assert not bpy.ops.cloudvdb.synthesise.poll() and not bpy.ops.cloudvdb.synthesise_sequence.poll()
    said = press()
    assert "poll" in said and "Select metaballs" in said, said
    choose(bpy.data.objects["Sun"])
    assert not bpy.ops.cloudvdb.synthesise.poll()


# What goes wrong.

@check
def no_command(folder):
    fresh(folder)
    choose(metaball())
    with command(os.path.join(folder, "nowhere")):
        said = press()
    assert "nowhere" in said and "make build" in said and "Preferences" in said, said
    with command(""):
        path, os.environ["PATH"] = os.environ["PATH"], folder
        try:
            said = press()
        finally:
            os.environ["PATH"] = path
    assert "was not found" in said and files(folder) == ["scene.blend"], (said, files(folder))


@check
def the_command_of_the_path(folder):
    fresh(folder)
    bin_folder = os.path.join(folder, "bin")
    os.makedirs(bin_folder)
    os.symlink(preferences().binary, os.path.join(bin_folder, "cloudvdb"))
    with command(""):
        path, os.environ["PATH"] = os.environ["PATH"], bin_folder
        try:
            assert not press("check")
        finally:
            os.environ["PATH"] = path
    with command(bin_folder):
        assert not press("check")


@check
def another_version(folder):
    fresh(folder)
    choose(metaball())
    with command(script(os.path.join(folder, "cloudvdb"), "echo cloudvdb 9.9.9")):
        said = press()
    assert "9.9.9" in said and "0.1" in said and "clouds" not in files(folder), said
    with command(script(os.path.join(folder, "else"), "echo hello")):
        said = press("check")
    assert "does not run as cloudvdb" in said and "hello" in said, said


@check
def a_command_that_fails(folder):
    fresh(folder)
    choose(metaball())
    version = 'if [ "$1" = --version ]; then echo cloudvdb 0.1.0; exit 0; fi'
    for line, words in (('echo \'{"event":"error","message":"layout.glb: the sky is falling. Hold it up.","code":1}\' >&2; exit 1',
                         "the sky is falling. Hold it up."),
                        ("echo 'error: unexpected argument' >&2; exit 2", "unexpected argument"),
                        ("kill -SEGV $$", "signal 11"), ("exit 0", "without a report")):
        with command(script(os.path.join(folder, "cloudvdb"), version, line)):
            said = press()
        assert words in said and words in message(), (line, said)
        assert files(folder) == ["cloudvdb", "scene.blend"] and not any(o.type == "VOLUME" for o in bpy.data.objects), files(folder)


@check
def the_commands_own_sentence(folder):
    fresh(folder, resolution="SIZE", voxel_size=0.001)
    choose(metaball())
    said = press()
    assert "voxels" in said and "--voxel-size" in said and files(folder) == ["scene.blend"], said


@check
def an_unsaved_file(folder):
    fresh()
    volume = cloud(metaball())
    assert vdb(volume).startswith(bpy.app.tempdir) and "not saved" in message() and os.path.isfile(vdb(volume))
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "scene.blend"))
    cloud(bpy.data.objects["Mball"])
    assert volume.data.filepath == "//clouds/Mball Cloud.vdb" and "not saved" not in message()


@check
def a_folder_that_takes_no_file(folder):
    scene = fresh(folder)
    choose(metaball())
    # For root too: nothing can be made there.
    scene.cloudvdb_settings.folder = "/proc/clouds"
    said = press()
    assert "/proc/clouds" in said and "choose another folder" in said, said
    scene.cloudvdb_settings.folder = os.path.join(folder, "scene.blend", "clouds")
    said = press()
    assert "scene.blend" in said and files(folder) == ["scene.blend"], said


@check
def cancelled_within_half_a_second_without_a_trace(folder):
    scene = fresh(folder, photons=500_000_000)
    choose(metaball())
    task = module().task.Task(bpy.context)
    begin = time.monotonic()
    while task.stage() != "photons" and time.monotonic() - begin < 20:
        assert not task.advance()
        time.sleep(0.01)
    assert task.stage() == "photons" and files(os.path.join(folder, "clouds"))
    begin = time.monotonic()
    task.cancel()
    seconds = time.monotonic() - begin
    assert seconds < 0.5, seconds
    assert files(folder) == ["scene.blend"] and task.job.process.poll() is not None, files(folder)
    # And a command that does not listen.
    version = 'if [ "$1" = --version ]; then echo cloudvdb 0.1.0; exit 0; fi'
    with command(script(os.path.join(folder, "cloudvdb"), version, "trap '' TERM INT", "while :; do :; done")):
        task = module().task.Task(bpy.context)
        time.sleep(0.2)
        begin = time.monotonic()
        task.cancel()
        seconds = time.monotonic() - begin
    assert seconds < 0.5 and task.job.process.poll() == -9, seconds
    assert files(folder) == ["cloudvdb", "scene.blend"]
    assert not scene.objects["Mball"].hide_render


# Export and import.

@check
def file_export_writes_what_blender_drops(folder):
    scene = fresh(folder, medium="stratus", detail="congestus")
    ball = metaball("Ball", kind="CAPSULE", co=(1, 2, 3))
    ball["cloudvdb"] = {"preset": "cumulus"}
    metaball("Ball.001")
    ico("Plain").data.materials.append(bpy.data.materials.new("Fog"))
    bpy.data.materials["Fog"]["cloudvdb"] = '{"sigma_t": 2.5}'
    light = sun()
    light.data.angle = 0.02
    sky(0.5)
    for extras in (True, False):
        document = exported(os.path.join(folder, "out.gltf"), export_extras=extras)
        nodes = {node["name"]: node for node in document["nodes"]}
        said = nodes["Ball"]["extensions"]["CLOUDVDB_metaballs"]
        assert said["family"] == "Ball" and abs(said["threshold"] - 0.6) < 1e-6
        assert said["elements"][0]["type"] == "CAPSULE" and [round(c, 5) for c in said["elements"][0]["co"]] == [1, 3, -2]
        assert nodes["Ball.001"]["extensions"]["CLOUDVDB_metaballs"]["family"] == "Ball"
        assert nodes["Ball"]["extras"]["cloudvdb"] == {"preset": "cumulus"} and document["materials"][0]["extras"]["cloudvdb"] == {"sigma_t": 2.5}
        top = document["scenes"][0]["extras"]
        assert list(top) == ["cloudvdb"], top
        assert abs(top["cloudvdb"]["sun_angle"] - 0.02) < 1e-6 and top["cloudvdb"]["sky"] == [0.5] * 3
        assert top["cloudvdb"]["medium"] == {"preset": "stratus"} and top["cloudvdb"]["detail"]["genus"] == "congestus"
        assert "CLOUDVDB_metaballs" in document["extensionsUsed"] and "CLOUDVDB_metaballs" not in document.get("extensionsRequired", [])
    # An image of the sky goes by its file; turned as a Mapping node turns it.
    image = bpy.data.images.new("Sky", 8, 4, float_buffer=True)
    image.file_format, image.filepath_raw = "OPEN_EXR", os.path.join(folder, "sky.exr")
    image.save()
    tree = scene.world.node_tree
    texture, mapping = tree.nodes.new("ShaderNodeTexEnvironment"), tree.nodes.new("ShaderNodeMapping")
    texture.image, mapping.inputs["Rotation"].default_value[2] = image, 0.5
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    found = exported(os.path.join(folder, "out.gltf"), export_extras=True)["scenes"][0]["extras"]["cloudvdb"]["sky"]
    assert os.path.samefile(found["image"], image.filepath_raw) and found["strength"] == 0.5 and abs(found["turn"] + 28.6479) < 1e-3, found
    # What the scene says itself stays; what cannot be read goes out as it is, for the command to complain of.
    scene["cloudvdb"] = '{"sun_angle": 0.1, "sky": 2}'
    top = exported(os.path.join(folder, "out.gltf"))["scenes"][0]["extras"]["cloudvdb"]
    assert top["sun_angle"] == 0.1 and top["sky"] == 2 and top["medium"] == {"preset": "stratus"}
    scene["cloudvdb"] = "{oops"
    assert exported(os.path.join(folder, "out.gltf"))["scenes"][0]["extras"]["cloudvdb"] == "{oops"


@check
def a_suns_strength_is_the_lamps_times_its_nodes(folder):
    """Blender 5.2's exporter forgets the lamp's own, 4.5's as soon as it has nodes."""
    scene = fresh(folder)
    metaball()
    light = sun(3.0)
    path = os.path.join(folder, "out.gltf")

    def lux():
        (lamp,) = exported(path)["extensions"]["KHR_lights_punctual"]["lights"]
        return lamp["intensity"]

    engines = [item.identifier for item in bpy.types.RenderSettings.bl_rna.properties["engine"].enum_items]
    others = [name for name in ("BLENDER_EEVEE_NEXT", "BLENDER_EEVEE", "BLENDER_WORKBENCH") if name in engines]
    for engine in ("CYCLES", *others):
        scene.render.engine = engine
        assert abs(lux() / (683 * 3) - 1) < 1e-5, (engine, lux())
    light.data.use_nodes = True
    (emission,) = (node for node in light.data.node_tree.nodes if node.type == "EMISSION")
    emission.inputs["Strength"].default_value = 2.0
    # EEVEE and Workbench know no nodes of lamps.
    for engine, strength in (("CYCLES", 6), *((name, 3) for name in others)):
        scene.render.engine = engine
        assert abs(lux() / (683 * strength) - 1) < 1e-5, (engine, lux())
    # The lamp that is written for the command is this one.
    scene.render.engine = "CYCLES"
    export = module().gltf_export
    dim = sun(4.0)
    assert export.sun_of(scene) == light and export.strength_of(dim.data) == 4.0


@check
def metaballs_come_back_from_gltf(folder):
    fresh(folder)
    ball = metaball("Ball", at=(1, 2, 3), kind="ELLIPSOID", co=(0.5, 0.25, -1))
    ball.rotation_euler, ball.scale = (0.3, 0.4, 0.5), (1, 2, 1)
    ball["cloudvdb"] = "cumulus"
    one = ball.data.elements[0]
    one.rotation, one.size_x, one.size_y, one.size_z, one.stiffness = (0.8, 0.6, 0, 0), 0.5, 0.7, 0.9, 3
    parent = link("Parent", None, location=(0, 0, 5))
    ball.parent = parent
    child = link("Child", None, location=(1, 0, 0))
    child.parent = ball
    bpy.context.view_layer.update()
    world, below = ball.matrix_world.copy(), child.matrix_world.copy()
    path = os.path.join(folder, "out.glb")
    bpy.ops.export_scene.gltf(filepath=path, export_extras=True)
    fresh()
    bpy.ops.import_scene.gltf(filepath=path)
    bpy.context.view_layer.update()
    back = bpy.data.objects["Ball"]
    assert back.type == "META" and back.parent.name == "Parent" and back["cloudvdb"]["preset"] == "cumulus"
    near = lambda a, b: max(abs(x - y) for row, other in zip(a, b) for x, y in zip(row, other)) < 1e-5
    assert near(back.matrix_world, world) and near(bpy.data.objects["Child"].matrix_world, below)
    got = back.data.elements[0]
    assert got.type == "ELLIPSOID" and abs(got.stiffness - 3) < 1e-6 and max(abs(a - b) for a, b in zip(got.co, (0.5, 0.25, -1))) < 1e-6
    assert max(abs(a - b) for a, b in zip((got.size_x, got.size_y, got.size_z), (0.5, 0.7, 0.9))) < 1e-6
    assert max(abs(a - b) for a, b in zip(got.rotation, (0.8, 0.6, 0, 0))) < 1e-6


@check
def regions_come_back_as_objects(folder):
    fresh(folder, medium="CUSTOM", sigma_t=20, photons=300_000)
    ball = metaball(radius=4, at=(1, 2, 3))
    choose(ball)
    assert not press("bring_regions", form="EMPTY"), message()
    empties = list(bpy.context.selected_objects)
    assert len(empties) > 10 and {e.empty_display_type for e in empties} == {"SPHERE"}
    assert f"{len(empties)} regions" in message(), message()
    assert max(abs(a - b) for a, b in zip((sum(e.location[k] for e in empties) / len(empties) for k in range(3)), (1, 2, 3))) < 1.2
    assert all((e.location - ball.location).length < 4 * 0.575 * 1.05 for e in empties)
    # They are a layout again: as many regions of the same medium.
    bpy.context.scene.cloudvdb_settings.density = "source"
    assert not press() and f"{len(empties)} regions as sketched" in message() and "Density 20" in message(), message()
    bpy.context.scene.cloudvdb_settings.density = "duality"
    choose(ball)
    assert not press("bring_regions", form="METABALL")
    (balls,) = bpy.context.selected_objects
    assert balls.type == "META" and len(balls.data.elements) == len(empties) and abs(balls["cloudvdb"]["sigma_s"] - 20 * 0.9999) < 1e-3
    assert not any(o.name.startswith("Mball.") and o.type == "MESH" for o in bpy.data.objects), "a stand-in stayed"
    assert len(files(folder)) == 3 and "clouds" in files(folder), files(folder)


@check
def regions_of_the_commands_own_gltf(folder):
    import subprocess
    fresh(folder)
    path = os.path.join(folder, "regions.glb")
    cumulus = os.path.join(SCENES, "cumulus.gltf")
    subprocess.run([preferences().binary, cumulus, "-o", path, "--photons", "20k", "-q"], check=True)
    assert not press("import_regions", filepath=path, form="METABALL")
    (balls,) = bpy.context.selected_objects
    document = module().regions.read(path)
    spheres = [n for n in document["nodes"] if n.get("extras", {}).get("cloudvdb", {}).get("shape") == "sphere"]
    assert len(balls.data.elements) == len(spheres) > 50
    x, y, z = spheres[0]["translation"]
    assert any(max(abs(a - b) for a, b in zip(e.co, (x, -z, y))) < 1e-2 for e in balls.data.elements)
    assert "no glTF" in press("import_regions", filepath=os.path.join(folder, "scene.blend"))
    assert "cannot be read" in press("import_regions", filepath=os.path.join(folder, "none.glb"))
    assert "no spherical regions" in press("import_regions", filepath=cumulus)


SCENES = ""


# Sequences.

@check
def a_sequence_of_frames(folder):
    scene = fresh(folder, frame_start=8, frame_end=11, density="source")
    ball = metaball()
    still = metaball("Still", at=(0, 6, 0))
    ball.keyframe_insert("location", frame=8)
    ball.location.x = 4
    ball.keyframe_insert("location", frame=10)
    scene.frame_set(3)
    choose(ball, still)
    assert not press("synthesise_sequence"), message()
    assert scene.frame_current == 3 and "4 of them new" in message(), message()
    names = [f"Mball Cloud.{frame:04}.vdb" for frame in range(8, 12)]
    where = os.path.join(folder, "clouds")
    assert files(where) == [*names, "Mball Cloud.frames.json"], files(where)
    volume = bpy.data.objects["Mball Cloud"]
    data = volume.data
    assert data.is_sequence and data.filepath == f"//clouds/{names[0]}" and (data.frame_start, data.frame_duration) == (8, 4)
    content = [open(os.path.join(where, name), "rb").read() for name in names]
    # The ball stands still from frame 10 on: the same seed makes the same bytes.
    assert content[2] == content[3] and content[0] != content[1]
    shown = []
    for frame in (8, 10):
        scene.frame_set(frame)
        data.grids.load()
        shown.append(data.grids.frame_filepath)
    assert [os.path.basename(path) for path in shown] == [names[0], names[2]], shown
    # Frames that are done stay; one that has changed is made again.
    before = [os.stat(os.path.join(where, name)).st_mtime_ns for name in names]
    choose(ball, still)
    assert not press("synthesise_sequence") and "0 of them new" in message(), message()
    os.remove(os.path.join(where, names[1]))
    ball.location.x = 5
    ball.keyframe_insert("location", frame=11)
    assert not press("synthesise_sequence") and "2 of them new" in message(), message()
    after = [os.stat(os.path.join(where, name)).st_mtime_ns for name in names]
    assert (before[0], before[2]) == (after[0], after[2]) and before[3] == after[3], "a file that Blender may have open was changed"
    assert data.filepath == "//clouds/Mball Cloud 2.0008.vdb" and len(files(where)) == 10, files(where)
    scene.cloudvdb_settings.frame_end = 7
    assert "before it starts" in press("synthesise_sequence")


@check
def a_growing_cloud_does_not_flicker(folder):
    """Voxel size and medium are the first frame's in all."""
    scene = fresh(folder, frame_start=1, frame_end=2, density="source", max_voxels=1_000_000)
    ball = metaball()
    ball.keyframe_insert("scale", frame=1)
    ball.scale = (1.5, 1.5, 1.5)
    ball.keyframe_insert("scale", frame=2)
    choose(ball)
    assert not press("synthesise_sequence"), message()
    with open(os.path.join(folder, "clouds", "Mball Cloud.frames.json")) as file:
        one, two = (entry["report"]["vdb"] for entry in json.load(file).values())
    assert abs(one["voxel_size"] - two["voxel_size"]) < 1e-6 and abs(one["density_scale"] / two["density_scale"] - 1) < 1e-6, (one, two)


@check
def a_stopped_sequence_goes_on(folder):
    scene = fresh(folder, frame_start=1, frame_end=3)
    ball = metaball()
    ball.keyframe_insert("location", frame=1)
    ball.location.x = 4
    ball.keyframe_insert("location", frame=3)
    scene.frame_set(2)
    choose(ball)
    task = module().sequence.Sequence(bpy.context)
    while task.at < 1 or task.job is None:
        assert not task.advance()
        time.sleep(0.005)
    task.cancel()
    where = os.path.join(folder, "clouds")
    assert files(where) == ["Mball Cloud.0001.vdb", "Mball Cloud.frames.json"] and scene.frame_current == 2, files(where)
    assert not press("synthesise_sequence") and "2 of them new" in message(), message()


# Baked light.

@check
def baked_light_comes_and_goes(folder):
    scene = fresh(folder, density="source", medium="smoke", bake="view", max_voxels=20_000)
    ball = metaball()
    sun()
    choose(ball)
    assert "no camera" in press() and "Any View" in message() and files(folder) == ["scene.blend"], message()
    camera().data.type = "ORTHO"
    assert "orthographic" in press(), message()
    scene.camera.data.type = "PERSP"
    volume = cloud(ball)
    slot, sorts = volume.data.materials, lambda: {node.name for node in volume.data.materials[0].node_tree.nodes}
    assert sorted(g.name for g in volume.data.grids) == ["density", "light"] and {"Live", "Baked Light"} <= sorts()
    # What nobody has touched is exchanged, under its name.
    own, name = scene.cloudvdb_settings, slot[0].name
    for bake, words in (("none", set()), ("isotropic", {"Live"}), ("sh2", {"Live"}), ("view", {"Live"})):
        own.bake = bake
        cloud(ball)
        assert slot[0].name == name and len(slot) == 1 and {"Live"} & sorts() == words and "yours" not in message(), (bake, message())
    assert len(bpy.data.node_groups) == 1 and len(volume.data.grids) == 2
    # The user's Density stays, the rest follows: light too.
    tree, medium = slot[0].node_tree, slot[0]
    tree.nodes["Density"].outputs[0].default_value, before = 3.0, tree.nodes["Baked Light"].node_tree.as_pointer()
    own.medium = "cumulus"
    own.medium, own.sigma_t, own.anisotropy = "CUSTOM", 2.0, 0.7
    cloud(ball)
    assert slot[0] == medium and tree.nodes["Density"].outputs[0].default_value == 3.0 and "Density of the material" in message(), message()
    assert abs(shader(volume).inputs["Anisotropy"].default_value - 0.7) < 1e-6 and len(bpy.data.node_groups) == 1
    own.bake = "none"
    cloud(ball)
    assert slot[0] == medium and "is yours, and was left, though Bake Light is now None" in message(), message()
    tree.nodes["Density"].outputs[0].default_value = 2.0
    slot.clear()
    cloud(ball)
    assert "Live" not in sorts() and "yours" not in message(), message()


@check
def what_shines_comes_and_goes(folder):
    scene = fresh(folder, density="source", medium="smoke", max_voxels=20_000)
    ball, own = metaball(), scene.cloudvdb_settings
    volume = cloud(ball)
    tree = lambda: volume.data.materials[0].node_tree
    plain = {node.name for node in tree().nodes}
    for bake, kelvin, also in (("none", 0, set()), ("isotropic", 0, {"Live"}), ("isotropic", 1500, {"Live"}), ("none", 1500, set())):
        own.bake, own.temperature = bake, kelvin
        own.emission, own.emission_color = (0 if kelvin else 5), (1.0, 0.5, 0.25)
        cloud(ball)
        shown = {node.name for node in tree().nodes}
        assert "emission" in [grid.name for grid in volume.data.grids] and "yours" not in message(), (bake, message())
        assert {"emission", "Live Volume"} <= shown and ({"Live"} & shown) == also, shown
    own.temperature, own.emission = 0, 5
    cloud(ball)
    shines = tree().nodes["emission"]
    emission = next(node for node in tree().nodes if node.type == "EMISSION")
    assert 4 < shines.outputs[0].default_value < 6 and [round(c, 4) for c in emission.inputs["Color"].default_value[:3]] == [1, 0.5, 0.25]
    # What the user has changed stays, and is told.
    shines.outputs[0].default_value = 50
    cloud(ball)
    assert tree().nodes["emission"].outputs[0].default_value == 50 and "shines by itself" in message(), message()
    volume.data.materials.clear()
    own.emission = 0
    cloud(ball)
    assert {node.name for node in tree().nodes} == plain and "yours" not in message(), message()


@check
def lamps_go_along_where_that_is_asked(folder):
    scene = fresh(folder, density="source")
    ball, export, path = metaball(), module().gltf_export, os.path.join(folder, "layout.glb")
    lamp = bpy.data.lights.new("Lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 100.0, 0.25
    scene.collection.objects.link(bpy.data.objects.new("Lamp", lamp))

    def written():
        export.write(path, export.Request(scene, [ball], scene.cloudvdb_settings))
        with open(path, "rb") as file:
            data = file.read()
        document = json.loads(data[20:20 + int.from_bytes(data[12:16], "little")])
        nodes = [node for node in document["nodes"] if "KHR_lights_punctual" in node.get("extensions", {})]
        return nodes, document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])

    assert written()[0] == []
    scene.cloudvdb_settings.lamps = True
    (node,), (light,) = written()
    assert node["extras"]["cloudvdb"] == {"lamp_radius": 0.25} and light["type"] == "point", node
    assert abs(light["intensity"] / (683 * 100 / (4 * math.pi)) - 1) < 1e-5, light


@check
def baked_sequences(folder):
    scene = fresh(folder, density="source", medium="smoke", bake="isotropic", max_voxels=20_000, frame_start=1, frame_end=2)
    ball = metaball()
    sun()
    ball.keyframe_insert("location", frame=1)
    ball.location.x = 1
    ball.keyframe_insert("location", frame=2)
    choose(ball)
    assert not press("synthesise_sequence"), message()
    volume = bpy.data.objects["Mball Cloud"]
    scene.frame_set(1)
    volume.data.grids.load()
    assert "Live" in volume.data.materials[0].node_tree.nodes and sorted(g.name for g in volume.data.grids) == ["density", "light"]
    choose(ball)
    assert not press("synthesise_sequence") and "0 of them new" in message(), message()
    # Only the first frame is compared with the path tracer, and the result says how it went.
    assert "baked light off by" in message(), message()
    with open(os.path.join(folder, "clouds", "Mball Cloud.frames.json")) as file:
        assert [len(frame["report"]["bake"]["errors"]) for frame in json.load(file).values()] == [3, 0]
    # Regions are brought without light.
    choose(ball)
    scene.cloudvdb_settings.density = "duality"
    assert not press("bring_regions", form="EMPTY"), message()


@check
def the_material_follows_the_light_of_each_frame(folder):
    scene = fresh(folder, density="source", medium="cumulus", bake="sh2", max_voxels=20_000, photons=300_000, frame_start=1,
                  frame_end=3)
    ball = metaball()
    light = sun()
    for frame, energy, angle in ((1, 2.0, 0.4), (3, 4.0, 0.9)):
        light.data.energy, light.rotation_euler = energy, (angle, 0.0, 0.3)
        light.data.keyframe_insert("energy", frame=frame)
        light.keyframe_insert("rotation_euler", frame=frame)
    choose(ball)
    assert not press("synthesise_sequence"), message()
    where = os.path.join(folder, "clouds")
    with open(os.path.join(where, "Mball Cloud.frames.json")) as file:
        told = [entry["report"]["bake"] for entry in json.load(file).values()]
    group = bpy.data.objects["Mball Cloud"].data.materials[0].node_tree.nodes["Baked Light"].node_tree
    scales = [said["parts"][0]["scale"] for said in told]
    assert abs(scales[2] / scales[0] - 2) < 1e-3, scales
    ways = []
    for frame, said in zip((1, 2, 3), told):
        scene.frame_set(frame)
        shown = group.evaluated_get(bpy.context.evaluated_depsgraph_get()).nodes
        assert abs(shown["Scale all"].outputs[0].default_value / said["parts"][0]["scale"] - 1) < 1e-5
        assert said["lobes"][0] > 0, told
        assert abs(shown["Lobe all"].outputs[0].default_value / said["lobes"][0] - 1) < 1e-5
        way, own = [socket.default_value for socket in shown["Sunlight"].inputs], light.matrix_world.to_3x3().col[2]
        assert max(abs(a + b) for a, b in zip(way, own)) < 1e-4, (way, own)
        ways.append(way)
    assert abs(ways[0][2] - ways[2][2]) > 0.1
    # What moves by its keys is not what the user has changed.
    choose(ball)
    scene.frame_set(2)
    assert not press("synthesise_sequence") and "0 of them new" in message() and "yours" not in message(), message()
    ball.scale = (1.1, 1.1, 1.1)
    assert not press("synthesise_sequence") and "3 of them new" in message() and "yours" not in message(), message()


@check
def progress_never_goes_back(folder):
    scene = fresh(folder, bake="view", max_voxels=20_000)
    sun()
    camera()
    choose(metaball())
    for bake, wanted, early in (("view", {"light", "bake"}, 0.05), ("none", {"regions"}, 0.1)):
        scene.cloudvdb_settings.bake = bake
        task, seen, stages = module().task.Task(bpy.context), [0.0], {}
        while not task.advance():
            seen.append(task.fraction())
            stages.setdefault(task.stage(), task.fraction())
            time.sleep(0.001)
        assert seen == sorted(seen) and 0.5 < seen[-1] <= 1.0 and wanted & set(stages), (stages, seen[-1])
        # Metaballs become voxels before anything else: that is no stage of the cloud's.
        assert stages.get("photons", 0.0) <= early, stages


# Layouts, presets, the rest of the buttons.

@check
def new_layouts(folder):
    scene = fresh(folder)
    for operator, count in (("add_cumulus", 1), ("scatter_field", 9), ("sunbeams", None)):
        assert not press(operator, seed=3)
        made = [o for o in bpy.context.selected_objects]
        assert made and all(o.type == "META" for o in made) and (count is None or len(made) == count)
        families = {module().metaballs.family(o.name) for o in made}
        assert len(families) == len(made), "clouds would melt into one another"
        choose(*made)
        assert not press(), message()
        shape = [tuple(e.co) for e in made[0].data.elements]
        size = made[0].dimensions.copy()
        assert min(size) > 0.3
        assert len(module().gltf_export.suns(scene)) == 1
        choose()
        assert not press(operator, seed=3)
        again = [o for o in bpy.context.selected_objects]
        assert [tuple(e.co) for e in again[0].data.elements] == shape, "the same seed, another cloud"
        scene = fresh(folder)
    press("add_cumulus", width=600.0, height=400.0)
    thing = bpy.context.object
    bpy.context.view_layer.update()
    assert 0.75 * 600 < thing.dimensions.x < 1.25 * 600 and 0.6 * 400 < thing.dimensions.z < 1.25 * 400, thing.dimensions[:]


@check
def presets_the_blender_way(folder):
    scene = fresh(folder)
    shipped = module().presets.SHIPPED
    names = sorted(os.listdir(shipped))
    assert len(names) >= 6
    for name in names:
        bpy.ops.script.execute_preset(filepath=os.path.join(shipped, name), menu_idname="CLOUDVDB_MT_presets")
    own = scene.cloudvdb_settings
    own.photons = 123_456
    bpy.ops.cloudvdb.preset(name="Mine")
    own.photons = 10_000
    path = next(os.path.join(p, "Mine.py") for p in bpy.utils.preset_paths("cloudvdb") if os.path.exists(os.path.join(p, "Mine.py")))
    bpy.ops.script.execute_preset(filepath=path, menu_idname="CLOUDVDB_MT_presets")
    assert own.photons == 123_456
    bpy.ops.cloudvdb.preset(name="Mine", remove_active=True)
    assert not os.path.exists(path)


@check
def layout_and_cloud_swap(folder):
    fresh(folder)
    ball = metaball()
    volume = cloud(ball)
    choose(volume)
    assert not press("show_layout") and volume.hide_render and not ball.hide_render and ball.display_type == "TEXTURED"
    assert not press("show_layout") and not volume.hide_render and ball.hide_render and ball.display_type == "BOUNDS"
    choose(ball)
    assert not bpy.ops.cloudvdb.show_layout.poll()


@check
def the_rest_of_the_buttons(folder):
    scene = fresh(folder)
    assert not press("check") and not press("add_sun") and not press("use_cycles")
    assert scene.cycles.samples == 64 and scene.render.engine == "CYCLES" and len(module().gltf_export.suns(scene)) == 1
    assert not bpy.ops.cloudvdb.cancel.poll()
    assert max(scene.world.node_tree.nodes["Background"].inputs[0].default_value[:3]) == 1.0


@check
def every_property_says_what_it_is(folder):
    scene = fresh(folder)
    for prop in scene.cloudvdb_settings.bl_rna.properties:
        assert prop.identifier in ("rna_type", "name") or prop.description, prop.identifier
    for name in dir(bpy.ops.cloudvdb):
        assert getattr(bpy.ops.cloudvdb, name).get_rna_type().description, name


@check
def disabled_it_leaves_nothing(folder):
    import addon_utils
    name = module().__name__
    fresh(folder)
    binary = preferences().binary
    bpy.ops.preferences.addon_disable(module=name)
    assert not hasattr(bpy.types.Scene, "cloudvdb_settings") and not hasattr(bpy.types, "CLOUDVDB_PT_cloud")
    ball = metaball()
    document = exported(os.path.join(folder, "out.gltf"))
    assert "extensionsUsed" not in document and ball.name in {n["name"] for n in document["nodes"]}
    bpy.ops.preferences.addon_enable(module=name)
    preferences().binary = binary
    choose(bpy.data.objects["Mball"])
    assert not press() and hasattr(bpy.types, "CLOUDVDB_PT_cloud")
