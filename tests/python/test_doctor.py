"""`cloudvdb doctor`: each finding has a file on either side of its rule, Blender agrees, and after the fix doctor is quiet.

OpenVDB's own Python module writes the files; all of them in one process, and Blender looks at them in one other.
"""
import json
import subprocess

import numpy as np
import pytest

import addon
import vdbinfo
from blender import blender

START = r"""
import os, sys
import numpy as np, pyopenvdb as vdb
os.chdir(sys.argv[1])

# A ball of 9 voxels' radius, of 0.1 m: 1.8 m across, optical depth 1.8.
place = np.stack(np.meshgrid(*[np.arange(24) - 11.5] * 3, indexing="ij"), -1)
BALL = (np.linalg.norm(place, axis=-1) < 9).astype(np.float32)

def linear(x=0.1, y=0.1, z=0.1, move=(0, 0, 0), lean=0.0):
    return vdb.createLinearTransform([[x, 0, 0, 0], [lean, y, 0, 0], [0, 0, z, 0], [*map(float, move), 1]])

def ball(name="density", values=BALL, transform=None, background=0.0):
    grid = vdb.FloatGrid(background)
    grid.name, grid.gridClass, grid.transform = name, vdb.GridClass.FOG_VOLUME, transform or linear()
    grid.copyFromArray(np.ascontiguousarray(values, np.float32), ijk=(-12, -12, -12))
    return grid

def write(file, *grids, **metadata):
    vdb.write(file + ".vdb", grids=list(grids), metadata=metadata)
"""

MAKE = START + r"""
write("ball", ball())
for name in ("smoke", "Density", ""):
    write("named_" + name, ball(name))
write("unnamed_beside", ball(), ball(""))
write("two", ball("temperature"), ball())
write("twice", ball(), ball(transform=linear(move=(3, 0, 0))))
surface = vdb.createLevelSetSphere(radius=0.9, voxelSize=0.1)
surface.name = "density"
write("levelset", surface)
surface.gridClass = vdb.GridClass.UNKNOWN
write("levelset_unsaid", surface)
write("background", ball(background=0.5))
for scale in (1e-8, 9e-4, 2e-3, 0.02, 90, 110, 7e4):
    write(f"times_{scale:g}", ball(values=BALL * scale))
for name, value in (("nan", float("nan")), ("inf", float("inf")), ("negative", -1.0)):
    grid = ball()
    grid.fill((0, 0, 0), (1, 0, 1), value)
    write(name, grid)
for off in (1.0, 0.0):
    grid = ball()
    for i, j, k in (np.argwhere(BALL > 0) - 12).tolist():
        if i >= 0:
            grid.fill((i, j, k), (i, j, k), off, False)
    write(f"off_{off:g}", grid)
grid = ball()
grid.fill((-12, -12, -12), (11, 11, 11), 1.0, False)
write("all_off", grid)
write("empty", ball(values=BALL * 0))
zeros = ball(values=BALL * 0)
zeros.fill((0, 0, 0), (3, 3, 3), 0.0)
write("zeros", zeros)
write("mirrored", ball(transform=linear(x=-0.1)))
write("sheared", ball(transform=linear(lean=0.05)))
write("stretched", ball(transform=linear(z=0.2)))
write("frustum", ball(transform=vdb.createFrustumTransform((-12, -12, -12), (12, 12, 12), 0.5, 2.4, 0.1)))
for metres in (20, 40, 1e7):
    write(f"away_{metres:g}", ball(transform=linear(move=(metres, 0, 0))))
write("large", ball(transform=linear(5, 5, 5)))
for side in (2038, 2039):
    grid = ball()
    grid.fill((side, 0, 0), (side, 0, 0), 1.0)
    write(f"long_{side}", grid)
for side in (990, 1000):
    grid = ball()
    grid.fill((side, side, side), (side, side, side), 1.0)
    write(f"wide_{side}", grid)
for name, kind, value in (("vectors", vdb.Vec3SGrid, (3.0, 0.0, 0.0)), ("bools", vdb.BoolGrid, True)):
    grid = kind()
    grid.name, grid.transform = "density", linear()
    for i, j, k in (np.argwhere(BALL > 0) - 12).tolist():
        grid.fill((i, j, k), (i, j, k), value)
    write(name, grid)
for metres in (1e-3, 0.02, 1.0, 30.0, 700.0):
    write(f"across_{metres:g}", ball(values=BALL * metres / 1.8))
for axis, name in ((1, "y"), (2, "z")):
    half = BALL.copy()
    half[tuple(slice(None) if a != axis else slice(0, 10) for a in range(3))] = 0
    write("base_" + name, ball(values=half))
    if name == "y":
        upright = vdb.createLinearTransform([[0.1, 0, 0, 0], [0, 0, 0.1, 0], [0, -0.1, 0, 0], [0, 0, 0, 1]])
        write("turned", ball(values=half, transform=upright))
box = np.zeros((24, 24, 24))
box[4:20, 4:20, 4:20] = 1
write("box", ball(values=box))
for number in (1, 2):
    os.makedirs("sequences", exist_ok=True)
    for name in (f"a_000{number}_density", f"b.000{number}", f"c_v{number}_low", f"d_000{number}_v2"):
        write("sequences/" + name, ball())
write("sequences/e_0001_density", ball())

# The fixes, as they are told.
grid = ball("")
grid.name = "density"
write("fixed_unnamed", grid)
grid = ball()
grid.fill((0, 0, 0), (1, 0, 1), 0.0)
write("fixed_inf", grid)
old = ball(background=0.5)
values = np.zeros((40, 40, 40), np.float32)
values[8:32, 8:32, 8:32] = BALL
grid = vdb.FloatGrid(0.0)
grid.name, grid.gridClass, grid.transform = "density", vdb.GridClass.FOG_VOLUME, old.transform
grid.copyFromArray(values, ijk=(-20, -20, -20))
write("fixed_background", grid)
write("fixed_mirrored", ball(values=BALL[::-1]))
write("fixed_away", ball(transform=linear(move=(0, 0, 0))))
grid = ball()
accessor = grid.getAccessor()
for i, j, k in (np.argwhere(BALL > 0) - 12).tolist():
    accessor.setActiveState((i, j, k), True)
write("fixed_off_1", grid)
write("fixed_times_0.0009", ball(values=BALL * 9e-4 * 1111))
"""

# What is found, problems with a mark. A pair is on either side of a rule.
FOUND = {
    "ball": [],
    "old": ["old-format"],
    "named_smoke": ["!no-density"],
    "named_Density": ["!no-density"],
    "named_": ["!unnamed"],
    "unnamed_beside": ["unnamed"],
    "two": [],
    "twice": ["!same-name"],
    "levelset": ["!level-set"],
    "levelset_unsaid": ["!level-set"],
    "background": ["!background"],
    "times_1e-08": ["!clipped", "!thin"],
    "times_0.0009": ["!clipped", "!thin"],
    "times_0.002": ["!thin", "range"],
    "times_0.02": ["thin"],
    "times_90": ["bounces"],
    "times_110": ["bounces", "range"],
    "times_70000": ["!thick", "bounces", "range"],
    "nan": ["!not-finite"],
    "inf": ["!not-finite"],
    "negative": ["negative"],
    "off_1": ["!inactive"],
    "off_0": [],
    "all_off": ["!empty"],
    "empty": ["!empty"],
    "zeros": ["!empty"],
    "mirrored": ["!mirrored"],
    "sheared": ["voxel-shape"],
    "stretched": ["voxel-shape"],
    "frustum": ["!frustum"],
    "away_20": [],
    "away_40": ["far-away"],
    "away_1e+07": ["!far-away"],
    "large": ["bounces", "clip-end"],
    "long_2038": ["clip-end"],
    "long_2039": ["clip-end", "texture-size"],
    "wide_990": ["clip-end"],
    "wide_1000": ["!dense-memory", "clip-end"],
    "vectors": ["vectors"],
    "bools": [],
    "across_0.001": ["!clipped", "!thin"],
    "across_0.02": ["thin"],
    "across_1": [],
    "across_30": ["bounces"],
    "across_700": ["!thick", "bounces", "range"],
    "base_y": ["y-up"],
    "base_z": [],
    "turned": [],
    "box": [],
    "sequences/a_0001_density": ["!digits-not-last"],
    "sequences/b.0001": [],
    "sequences/c_v1_low": [],
    "sequences/d_0001_v2": ["!digits-not-last"],
    "sequences/e_0001_density": [],
    "fixed_unnamed": [],
    "fixed_inf": [],
    "fixed_background": [],
    "fixed_mirrored": [],
    "fixed_away": [],
    "fixed_off_1": [],
    "fixed_times_0.0009": [],
}


def debian(script, *arguments):
    done = subprocess.run(["/usr/bin/python3", "-c", script, *map(str, arguments)], capture_output=True, text=True, cwd="/")
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    debian(MAKE, folder)
    old = bytearray((folder / "ball.vdb").read_bytes())
    # The format before, which differs in nothing that this file has.
    old[8:12] = (223).to_bytes(4, "little")
    (folder / "old.vdb").write_bytes(old)
    return folder


def doctor(cloudvdb, path):
    """The document; the exit code must say the same."""
    ran = cloudvdb.run("doctor", path, "--json")
    found = json.loads(ran.out)
    problems = [f for f in found["findings"] if f["severity"] == "problem"]
    assert (ran.code, found["healthy"], ran.err) == (1 if problems else 0, not problems, ""), ran
    assert [f["severity"] for f in found["findings"]] == sorted((f["severity"] for f in found["findings"]), reverse=True)
    return found


def ids(found):
    return sorted(("!" if f["severity"] == "problem" else "") + f["id"] for f in found["findings"])


def fix(found, name):
    (text,) = [f["fix"] for f in found["findings"] if f["id"] == name]
    return text


@pytest.mark.parametrize("name", FOUND)
def test_found(cloudvdb, files, name):
    found = doctor(cloudvdb, files / f"{name}.vdb")
    assert ids(found) == sorted(FOUND[name]), json.dumps(found["findings"], indent=1)
    for finding in found["findings"]:
        assert finding["says"].endswith(".") and finding["fix"] and not finding["fix"].endswith(".")
        assert any(c.isdigit() for c in finding["says"]) or finding["id"] in ("no-density", "unnamed", "vectors", "frustum", "empty"), finding


@pytest.mark.parametrize("name", ["ball", "background", "negative", "two", "stretched", "vectors", "long_2039"])
def test_figures_are_openvdbs(cloudvdb, files, name):
    found = doctor(cloudvdb, files / f"{name}.vdb")
    there = json.loads(debian(START + r"""
import json
grids, _ = vdb.readAll("%s.vdb")
out = []
for g in grids:
    on = [v.value for v in g.citerOnValues()] if g.valueTypeName == "float" else []
    low, high = g.evalActiveVoxelBoundingBox()
    out.append(dict(name=g.name, type=g.valueTypeName, active=g.activeVoxelCount(), box=[list(low), list(high)], leaves=g.leafCount(),
                    memory=g.memUsage(), lowest=min(on, default=None), highest=max(on, default=None)))
print(json.dumps(out))
""" % name, files))
    for ours, theirs in zip(*(sorted(grids, key=lambda grid: grid["name"]) for grids in (found["grids"], there)), strict=True):
        values = ours["values"]
        assert (ours["name"], ours["type"], values["active_voxels"], values["leaves"]) == (
            theirs["name"], theirs["type"], theirs["active"], theirs["leaves"])
        assert values["index_box"] == theirs["box"]
        if theirs["lowest"] is not None:
            assert (values["lowest"], values["highest"]) == (theirs["lowest"], theirs["highest"])


LOOK = r"""
import os
scene = start()
scene.render.engine = "CYCLES"
scene.render.resolution_x = scene.render.resolution_y = 24
scene.render.film_transparent, scene.cycles.samples, scene.cycles.use_denoising = True, 32, False
scene.render.image_settings.file_format = "OPEN_EXR"
if bpy.app.version >= (5, 0, 0):
    scene.cycles.volume_biased = True
sun()
eye = camera(at=(0, -10, 0), ortho=2.4)

def look(file, density=1.0, attribute="density", clipping=1e-3, at=(0, 0, 0), turn=0.0, scale=(1, 1, 1)):
    volume = import_volume(os.path.join(given["folder"], file + ".vdb"))
    volume.rotation_euler.x, volume.scale, volume.data.render.clipping = turn, scale, clipping
    eye.location = (at[0], at[1] - 10, at[2])
    return picture(volume, density, attribute)

def picture(volume, density=1.0, attribute="density"):
    principled(volume, density, 0.0)
    shader = next(n for n in volume.data.materials[0].node_tree.nodes if n.type == "PRINCIPLED_VOLUME")
    shader.inputs["Density Attribute"].default_value = attribute
    scene.render.filepath = os.path.abspath("look.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath, check_existing=False)
    alpha = np.array(image.pixels[:]).reshape(24, 24, -1)[..., 3]
    bpy.data.images.remove(image)
    bpy.data.objects.remove(volume)
    return alpha

for key, (file, options) in given["looks"].items():
    arrays[key] = look(file, **options)
# What the fix of a level set says: its surface as a mesh, and that filled.
source = import_volume(os.path.join(given["folder"], "levelset.vdb"))
mesh, volume = link("Mesh", bpy.data.meshes.new("Mesh")), link("Fog", bpy.data.volumes.new("Fog"))
made, filled = mesh.modifiers.new("Mesh", "VOLUME_TO_MESH"), volume.modifiers.new("Fog", "MESH_TO_VOLUME")
made.object, made.grid_name, made.threshold = source, "density", 0.0
filled.object, filled.voxel_amount = mesh, 48
source.hide_render = mesh.hide_render = True
eye.location = (0, -10, 0)
arrays["levelset, filled"] = picture(volume)
out["most_bounces"] = scene.cycles.bl_rna.properties["volume_bounces"].hard_max
out["default_bounces"] = [scene.cycles.bl_rna.properties[k].default for k in ("volume_bounces", "max_bounces")]

def frames(names):
    folder = os.path.join(given["folder"], "sequences")
    bpy.ops.object.volume_import(filepath=os.path.join(folder, names[0]), directory=folder, files=[{"name": name} for name in names],
                                 relative_path=False)
    volume, shown = bpy.context.object, []
    for frame in (1, 2):
        scene.frame_set(frame)
        grids = volume.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.grids
        grids.load()
        shown.append(os.path.basename(grids.frame_filepath))
    return shown

out["frames"] = {k: frames(v) for k, v in given["sequences"].items()}

bpy.ops.wm.read_factory_settings()
views = [a.spaces.active for s in bpy.data.screens for a in s.areas if a.type == "VIEW_3D"]
out["clip_end"] = [bpy.data.cameras[0].clip_end, bpy.data.cameras.new("New").clip_end, max(view.clip_end for view in views)]
"""

LOOKS = {name: (name, {}) for name in (
    "ball", "old", "named_smoke", "named_Density", "named_", "twice", "levelset", "background", "times_0.0009", "inf", "negative", "off_1", "empty",
    "zeros", "all_off", "mirrored", "frustum", "vectors", "bools", "across_0.02", "fixed_unnamed", "fixed_inf", "fixed_background",
    "fixed_mirrored", "fixed_times_0.0009")}
LOOKS |= {
    "attribute": ("named_smoke", {"attribute": "smoke"}),
    "no attribute": ("named_", {"attribute": ""}),
    "dense": ("times_0.0009", {"density": 1 / 9e-4}),
    "dense, no clipping": ("times_0.0009", {"density": 1 / 9e-4, "clipping": 0.0}),
    "above clipping": ("times_0.002", {"density": 500.0}),
    "mirrored back": ("mirrored", {"scale": (-1, 1, 1)}),
    "second": ("twice", {"at": (3, 0, 0)}),
    "away": ("away_1e+07", {"at": (1e7, 0, 0)}),
    "aside": ("away_40", {"at": (40, 0, 0)}),
    "y-up": ("base_y", {}),
    "y-up turned": ("base_y", {"turn": np.pi / 2}),
    "z-up": ("base_z", {}),
}


@pytest.mark.parametrize("version", ["4.5", "5.2"])
def test_blender_agrees(cloudvdb, files, version):
    python = None if version == "4.5" else addon.bpy52()
    looks = dict(LOOKS)
    density = doctor(cloudvdb, files / "across_0.02.vdb")["optical_depth"]["set_density"]
    looks["across_0.02, set"] = ("across_0.02", {"density": density})
    sequences = {"a": ["a_0001_density.vdb", "a_0002_density.vdb"], "b": ["b.0001.vdb", "b.0002.vdb"]}
    seen = blender(LOOK, python=python, folder=str(files), looks=looks, sequences=sequences)
    alpha = seen["arrays"]
    shows = {name: float(image[11:13, 11:13].mean()) for name, image in alpha.items()}

    def same(name, other="ball", within=0.08):
        return np.abs(alpha[name] - alpha[other]).mean() < within * alpha[other].mean()

    # 1 - e^-1.8 through the middle.
    assert shows["ball"] == pytest.approx(0.83, abs=0.04)
    for nothing in ("named_smoke", "named_Density", "named_", "no attribute", "empty", "zeros", "all_off", "times_0.0009", "dense", "second"):
        assert alpha[nothing].max() < 0.02, nothing
    for whole in ("old", "attribute", "dense, no clipping", "above clipping", "negative", "vectors", "bools", "aside", "fixed_unnamed", "fixed_inf",
                  "fixed_background", "fixed_mirrored", "fixed_times_0.0009", "twice"):
        assert same(whole) or whole == "fixed_mirrored" and same(whole, within=0.2), whole
    assert shows["levelset"] < 0.6 * shows["ball"] and not same("levelset", within=0.3)
    assert np.abs(alpha["inf"] - alpha["ball"]).max() > 0.2 and not same("away", within=0.3)
    assert shows["levelset, filled"] > 0.7 and alpha["levelset, filled"][2:4, 11:13].max() < 0.3
    # The two Blenders differ in these, and doctor says so.
    old = version == "4.5"
    assert (alpha["background"].mean() > 1.2 * alpha["ball"].mean()) == old
    assert (alpha["mirrored"].max() < 0.02, alpha["mirrored back"].max() < 0.02) == (old, old)
    # A frustum as deep as the ball's box and half as wide at its end: neither sees that.
    assert alpha["frustum"].mean() < 0.1 * alpha["ball"].mean() if old else same("frustum")
    assert same("off_1") == old
    # What is thin shows at the Density that doctor names.
    assert shows["across_0.02"] < 0.03 and shows["across_0.02, set"] > 0.98
    # Lying on its side, and upright: 90 degrees about X.
    assert same("y-up turned", "z-up", within=0.2) and not same("y-up", "z-up", within=0.3)
    assert (seen["clip_end"], seen["most_bounces"], seen["default_bounces"]) == ([100.0, 1000.0, 1000.0], 1024, [0, 12])
    assert seen["frames"] == {"a": ["a_0001_density.vdb"] * 2, "b": ["b.0001.vdb", "b.0002.vdb"]}


def test_optical_depth_is_that_of_cycles_and_of_the_samples(cloudvdb, files):
    depth = doctor(cloudvdb, files / "stretched.vdb")["optical_depth"]
    assert depth["along"] == pytest.approx([1.8, 1.8, 3.6], rel=1e-6) and depth["density_from"] == "default"
    assert doctor(cloudvdb, files / "across_30.vdb")["optical_depth"]["set_bounces"] == 64


def test_the_fixes_name_what_is_there(cloudvdb, files):
    named = doctor(cloudvdb, files / "named_smoke.vdb")
    assert "smoke" in fix(named, "no-density") and "Density Attribute" in fix(named, "no-density")
    digits = fix(doctor(cloudvdb, files / "sequences" / "a_0001_density.vdb"), "digits-not-last")
    assert "a_density.0001.vdb" in digits
    assert "d_v2.0001.vdb" in fix(doctor(cloudvdb, files / "sequences" / "d_0001_v2.vdb"), "digits-not-last")
    # The ball's middle is half a voxel below that.
    assert "Location (-39.9, 0.05, 0.05)" in fix(doctor(cloudvdb, files / "away_40.vdb"), "far-away")


def test_the_density_that_it_names_is_quiet(cloudvdb, files, tmp_path):
    """Multiplied into the values, the Density that doctor names leaves no finding of depth."""
    for name in ("across_0.02", "times_0.002", "across_700"):
        density = doctor(cloudvdb, files / f"{name}.vdb")["optical_depth"]["set_density"]
        debian(START + f"""
grid = vdb.read({str(files / (name + '.vdb'))!r}, "density")
grid.mapOn(lambda value: value * {density!r})
write("again", grid)
""", tmp_path)
        assert not {"thin", "!thin", "!thick"} & set(ids(doctor(cloudvdb, tmp_path / "again.vdb"))), name


@pytest.mark.parametrize("scene, flags", [
    ("cumulus", ["--grids", "density,source"]), ("cumulus", ["--density", "source", "--float32"]), ("cumulus", ["--up", "y"]),
    ("two_spheres", []), ("slab", [])])
def test_what_cloudvdb_writes_is_healthy(cloudvdb, scenes, tmp_path, scene, flags):
    cloudvdb.make(scenes / f"{scene}.gltf", tmp_path, *flags, "--photons", "20k")
    found = doctor(cloudvdb, tmp_path / "out.vdb")
    assert found["healthy"] and found["optical_depth"]["density_from"] == "density_scale", found["findings"]
    assert set(ids(found)) <= {"bounces", "clip-end", "y-up"}, ids(found)


def test_unreadable_files_are_sentences(cloudvdb, files, tmp_path):
    cloudvdb.refuse("doctor", tmp_path / "none.vdb", says=["none.vdb"])
    cloudvdb.refuse("doctor", tmp_path, says=["not a file"])
    (tmp_path / "text.vdb").write_text("no grid here")
    cloudvdb.refuse("doctor", tmp_path / "text.vdb", says=["text.vdb", "no VDB", "again"])
    cloudvdb.refuse("doctor", code=2, says=["input"])
    whole = (files / "ball.vdb").read_bytes()
    old = bytearray(whole)
    old[8:12] = (215).to_bytes(4, "little")
    (tmp_path / "old.vdb").write_bytes(old)
    cloudvdb.refuse("doctor", tmp_path / "old.vdb", says=["215", "222"])
    for cut in range(1, len(whole), len(whole) // 12):
        (tmp_path / "cut.vdb").write_bytes(whole[:cut])
        cloudvdb.refuse("doctor", tmp_path / "cut.vdb", says=["cut.vdb"], folder=tmp_path)


def test_damaged_trees_are_findings_and_never_a_crash(cloudvdb, files, tmp_path):
    whole = (files / "two.vdb").read_bytes()
    codes, damaged = set(), 0
    for at in range(60, len(whole), len(whole) // 25):
        (tmp_path / "bent.vdb").write_bytes(whole[:at] + bytes([whole[at] ^ 0x5A]) + whole[at + 1:])
        ran = cloudvdb.run("doctor", tmp_path / "bent.vdb", "--json")
        assert ran.code in (0, 1) and (ran.out or len(ran.err.strip().splitlines()) == 1), ran
        damaged += bool(ran.out) and "!damaged" in ids(json.loads(ran.out))
        codes.add(ran.code)
    assert damaged > 3 and codes == {0, 1}


def test_the_table_says_the_same(cloudvdb, files):
    ran = cloudvdb.run("doctor", files / "named_smoke.vdb")
    assert ran.code == 1 and ran.err == ""
    for word in ("PROBLEM [no-density]", "Fix: ", "3112 active voxels", '"smoke"', "fog volume", "optical depth 1.8", "1 problem, 0 hints"):
        assert word in ran.out, (word, ran.out)
    assert cloudvdb.succeed("doctor", files / "ball.vdb").out.strip().endswith("healthy, 0 hints")
    assert vdbinfo.read(files / "ball.vdb")["grids"]["density"]["active"] == 3112
