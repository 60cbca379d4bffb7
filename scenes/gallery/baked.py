"""Takes `baked.png`: scenes/cumulus.gltf in Cycles, 4 samples a pixel, no denoiser; left scattering, right with its light baked.

    target/release/cloudvdb scenes/cumulus.gltf --bake view -o out/cumulus.vdb -o out/cumulus.blend.py
    .venv/bin/python -I scenes/gallery/baked.py out/cumulus.blend.py live left.png
    .venv/bin/python -I scenes/gallery/baked.py out/cumulus.blend.py baked right.png     # then side by side: convert left.png right.png +append
"""
import os
import runpy
import sys
import time

import bpy

script, mode, target = sys.argv[1:4]
bpy.ops.wm.read_factory_settings(use_empty=True)
runpy.run_path(script, run_name="__main__")
scene = bpy.context.scene
scene.cycles.samples, scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = 4, False, False
scene.cycles.volume_bounces = scene.cycles.max_bounces = 256 if mode == "live" else 0
scene.render.resolution_x, scene.render.resolution_y = 480, 270
scene.view_settings.exposure = 0.5
for material in bpy.data.materials:
    if "Live" in material.node_tree.nodes:
        material.node_tree.nodes["Live"].outputs[0].default_value = float(mode == "live")
scene.render.filepath = os.path.abspath(target)
begin = time.time()
bpy.ops.render.render(write_still=True)
print(f"{mode}: {time.time() - begin:.1f} s")
