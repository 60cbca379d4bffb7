"""The README's picture of the add-on: `.venv/bin/python scenes/gallery/addon.py` (after `make build`; needs blender, Xvfb, xdotool, imagemagick).

Debian's Blender in a real window of 1280 x 800 pixels under Xvfb, its own cumulus, a real press of the mouse on Synthesise Cloud:
before, while photons fly, and after, nothing selected. Two minutes where software draws the screen. Nothing is written but the picture.
"""
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "tests" / "python"))

from test_addon_window import BUTTON, LAYOUT, RUNNING, TAB  # noqa: E402
from window import window  # noqa: E402

#: Below the title bar; the panels at the right are Blender's own.
CROP = "1057x773+0+27"


def main():
    with tempfile.TemporaryDirectory() as folder, window() as screen:
        shots = [pathlib.Path(folder) / f"{name}.png" for name in ("before", "during", "after")]
        screen.say(LAYOUT.format(photons=5_000_000) + "view()[1].spaces.active.region_3d.view_distance = 9.0\n")
        screen.press(*TAB)
        screen.move(300, 600)
        screen.shoot(shots[0])
        screen.press(*BUTTON)
        screen.until(RUNNING)
        screen.until("addon.synthesise.running.fraction() > 0.2")
        screen.shoot(shots[1])
        screen.until("addon.synthesise.running is None", timeout=200)
        screen.say("[thing.select_set('Cloud' in thing.name) for thing in bpy.data.objects]; bpy.data.objects['Cumulus'].hide_set(True); draw()")
        screen.move(300, 600)
        screen.shoot(shots[2])
        subprocess.run(["convert", *map(str, shots), "-crop", CROP, "+repage", "-resize", "50%", "+append", "-colors", "200",
                        f"PNG8:{HERE / 'addon.png'}"], check=True)


if __name__ == "__main__":
    main()
