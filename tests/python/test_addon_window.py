"""The add-on in a real window, pressed by a real mouse: Debian's Blender under Xvfb. Skipped where they are not installed. Minutes on a
machine whose screen is drawn by software: `make crosscheck`.

`CLOUDVDB_PICTURES` names a folder for the screenshots."""
import os
import pathlib
import time

import pytest

from window import window

pytestmark = pytest.mark.long

#: Of the window's 1280 x 800 pixels: the sidebar's tab, and the button below the presets and the two switches.
TAB, BUTTON = (1044, 244), (930, 210)
LAYOUT = """
view()[1].spaces.active.show_region_ui = True
bpy.data.objects.remove(bpy.data.objects["Cube"])
bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath("work.blend"))
inside(bpy.ops.cloudvdb.add_cumulus)
bpy.context.scene.cloudvdb_settings.photons = {photons}
inside(bpy.ops.ed.undo_push, message="layout")
draw()
"""
CLOUD = "'Cumulus Cloud' in bpy.data.objects"
RUNNING = "addon.synthesise.running is not None"
FILES = "out['files'] = sorted(os.listdir('clouds')) if os.path.isdir('clouds') else []"


@pytest.fixture(scope="module")
def screen(cloudvdb):
    with window() as screen:
        yield screen


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = pathlib.Path(os.environ.get("CLOUDVDB_PICTURES") or tmp_path_factory.mktemp("pictures"))
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def test_the_button_the_progress_and_escape(screen, pictures):
    """One press of the mouse starts it; Blender stays awake; Esc ends it within half a second and leaves nothing."""
    screen.say(LAYOUT.format(photons=100_000_000))
    screen.press(*TAB)
    screen.move(400, 600)
    screen.shoot(pictures / "before.png")
    screen.press(*BUTTON)
    screen.until(RUNNING, timeout=10)
    screen.until("addon.synthesise.running and addon.synthesise.running.stage() == 'photons' and addon.synthesise.running.fraction() > 0.06")
    screen.move(400, 600)
    # Awake: a key of the user's works meanwhile.
    screen.key("KP_1")
    screen.until("view()[1].spaces.active.region_3d.view_perspective == 'ORTHO'", timeout=20)
    screen.settle()
    screen.shoot(pictures / "during.png")
    assert any(name.startswith(".cloudvdb") for name in screen.say(FILES)["files"])
    screen.say("bpy.app.driver_namespace['job'] = addon.synthesise.running.job")
    begin = time.monotonic()
    screen.key("Escape")
    screen.until("addon.synthesise.running is None")
    seconds = time.monotonic() - begin
    assert seconds < 0.5, seconds
    found = screen.say(FILES + f"; out['cloud'] = {CLOUD}; out['code'] = bpy.app.driver_namespace['job'].process.poll()")
    assert found == {"files": [], "cloud": False, "code": found["code"]} and found["code"] is not None, found


def test_a_press_makes_a_cloud_in_one_undo_step(screen, pictures):
    screen.say("bpy.context.scene.cloudvdb_settings.photons = 100_000; inside(bpy.ops.ed.undo_push, message='photons')")
    screen.press(*BUTTON)
    # A run may be over before anyone looks.
    seconds = screen.until(CLOUD)
    screen.move(400, 600)
    screen.shoot(pictures / "after.png")
    state = (f"out['cloud'] = {CLOUD}; out['hidden'] = bpy.data.objects['Cumulus'].hide_render; "
             "out['bounces'] = bpy.context.scene.cycles.volume_bounces; out['layout'] = 'Cumulus' in bpy.data.objects; " + FILES)
    made = {"cloud": True, "hidden": True, "bounces": 64, "layout": True, "files": ["Cumulus Cloud.vdb"]}
    assert screen.say(state) == made
    screen.say("inside(bpy.ops.ed.undo)")
    assert screen.say(state) == {**made, "cloud": False, "hidden": False, "bounces": 0}
    screen.say("inside(bpy.ops.ed.redo)")
    assert screen.say(state) == made
    assert seconds < 30


def test_an_undone_second_press_shows_the_first_cloud_again(screen):
    path = "out['path'] = bpy.path.abspath(bpy.data.objects['Cumulus Cloud'].data.filepath); out['there'] = os.path.isfile(out['path'])"
    first = screen.say(path)
    screen.press(*BUTTON)
    screen.until(f"bpy.path.abspath(bpy.data.objects['Cumulus Cloud'].data.filepath) != {first['path']!r}")
    screen.until("addon.synthesise.running is None")
    second = screen.say(path)
    assert second["there"]
    screen.say("inside(bpy.ops.ed.undo)")
    assert screen.say(path) == first and first["there"]


def test_an_error_is_blenders_report(screen):
    """The command's sentence, and the button works again after."""
    screen.say("addon_preferences = bpy.context.preferences.addons['cloudvdb'].preferences; bpy.app.driver_namespace['binary'] = "
               "addon_preferences.binary; addon_preferences.binary = '/nowhere/cloudvdb'")
    screen.press(*BUTTON)
    screen.until("'/nowhere/cloudvdb' in bpy.context.scene.cloudvdb_settings.message")
    screen.say("bpy.context.preferences.addons['cloudvdb'].preferences.binary = bpy.app.driver_namespace['binary']")
    screen.until("addon.synthesise.running is None")
