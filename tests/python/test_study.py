"""`cloudvdb study --paper`: its figures against the main command's with the same seeds, its tables against each other, its manners."""
import csv
import json
import statistics

import numpy as np
import pytest

import gltf
from command import SCENES, interrupt, listing, refuse, succeed

ONE, TWO, THREE = (SCENES / f"hura2006_{n}.gltf" for n in (1, 2, 3))
SEED, SEEDS = 70, 3
# The thesis's tables 3 and 4: regions, photons, photons in an estimate, seconds, megabytes, regions created.
THESIS = {"2": (2, 10_000, 100, 92, 22, 36), "3": (3, 10_000, 100, 617, 25, 55)}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Tests 2 and 3, the shortest, with the layouts and the tests in no order: what was printed, and the folder."""
    folder = tmp_path_factory.mktemp("study") / "out"
    ran = succeed("study", "--paper", THREE, ONE, TWO, "--tests", "3,2", "--seeds", SEEDS, "--seed", SEED, "--json", "-o", folder)
    return json.loads(ran.out), folder, ran


@pytest.fixture(scope="module")
def savings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("savings") / "out"
    ran = succeed("study", "--paper", THREE, "--tests", "savings", "--seed", SEED, "--json", "-q", "-o", folder)
    return json.loads(ran.out), folder, ran


def picture(scene, target, *arguments):
    ran = succeed(scene, "--integrator", "photon", "--spp", 4, "--shadow-rays", 4, "--size", "100x100", "--seed", SEED,
                  "-o", target, "--json", "-q", *arguments)
    return json.loads(ran.out), target.read_bytes()


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


# ------------------------------------------------------------------------------------------------------------- figures

def test_the_thesis_figures_stand_in_its_order(small):
    found, _, ran = small
    assert [test["test"] for test in found["tests"]] == ["2", "3"] and found["savings"] == [] and found["model"] == "hura2006"
    for test in found["tests"]:
        thesis = test["thesis"]
        assert (test["regions"], test["photons"], test["estimate"], thesis["seconds"], thesis["megabytes"], thesis["made"]) \
            == THESIS[test["test"]]
    # A line for each as soon as it is known.
    assert [line.split()[0] for line in ran.err.splitlines()] == ["2", "3"]


def test_a_test_is_the_main_job_with_the_same_settings(small, tmp_path):
    """The same regions, the same picture to the byte, and a memory that is the test's own and not its predecessors'."""
    found, folder, _ = small
    report, png = picture(THREE, tmp_path / "main.png", "--model", "hura2006", "--photons", "10k", "--estimate", 100)
    test = found["tests"][1]
    assert test["counts"][0] == report["regions"]["synthesised"]
    assert png == (folder / "test3.png").read_bytes()
    for name in ("collisions", "mean_radiance", "relative_error", "spp", "width", "height"):
        assert test["render"][name] == report["render"][name], name
    assert 0.5 * report["peak_memory"] < test["peak_memory"] < 2 * report["peak_memory"]


def test_other_seeds_are_counted(small):
    for test, scene in zip(small[0]["tests"], (TWO, THREE)):
        counts = [json.loads(succeed(scene, "--model", "hura2006", "--photons", "10k", "--estimate", 100, "--seed", SEED + i,
                                     "--json", "-q").out)["regions"]["synthesised"] for i in range(SEEDS)]
        assert test["counts"] == counts
        assert test["mean"] == pytest.approx(statistics.mean(counts)) and test["deviation"] == pytest.approx(statistics.stdev(counts))


def test_tables_say_what_the_json_says(small):
    found, folder, ran = small
    for test, row, line in zip(found["tests"], rows(folder / "tests.csv"), ran.err.splitlines(), strict=True):
        printed = line.split()
        asked = [f"{test['regions']}", f"{test['photons']}", f"{test['estimate']}", f"{test['thesis']['seconds']:.0f}"]
        assert printed[1:5] == asked and printed[6] == f"{test['thesis']['megabytes']:.0f}"
        assert printed[8:] == [f"{test['thesis']['made']:.0f}", f"{test['mean']:.1f}", "+-", f"{test['deviation']:.1f}"]
        assert [row["test"], row["regions"], row["photons"], row["estimate"]] == [test["test"], *asked[:3]]
        assert float(row["seconds"]) == pytest.approx(test["seconds"], abs=1e-3)
        assert float(row["created_mean"]) == test["mean"] and float(row["thesis_created"]) == test["thesis"]["made"]
    assert json.loads((folder / "study.json").read_text()) == found


def test_the_same_seed_gives_the_same_on_any_number_of_threads(small):
    found, folder, ran = small
    again = succeed("study", "--paper", THREE, "--tests", "3", "--seeds", SEEDS, "--seed", SEED, "-q", "--threads", 1,
                    "-o", folder.parent / "again")
    assert (folder / "test3.png").read_bytes() == (folder.parent / "again" / "test3.png").read_bytes()
    # The table on stdout has the lines that stderr had before.
    line, = [line.split() for line in again.out.splitlines() if line.startswith("3 ")]
    before = ran.err.splitlines()[1].split()
    assert line[:5] == before[:5] and line[8:] == before[8:] and not again.err


def test_savings_are_those_of_the_main_job(savings, tmp_path):
    found, folder, ran = savings
    assert not ran.err
    entry, = found["savings"]
    settings = ("--photons", "100k", "--estimate", 500, "--density")
    shown = {"source": picture(THREE, tmp_path / "source.png", *settings, "source"),
             "duality": picture(THREE, tmp_path / "duality.png", *settings, "duality")}
    for side, (report, png) in shown.items():
        ours, render = entry[side], report["render"]
        assert ours["queries"] == render["collisions"] and ours["relative_error"] == render["relative_noise"]
        assert ours["mean_difference"] == pytest.approx(render["mean_radiance"] / entry["reference"] - 1)
        assert ours["queries_at_equal"] == pytest.approx(render["collisions"] * (render["relative_noise"] / 0.1) ** 2)
        assert png == (folder / f"savings3_{side}.png").read_bytes()
    report = shown["duality"][0]
    assert entry["duality"]["regions"] == report["regions"]["synthesised"] and entry["source"]["regions"] == 3
    assert entry["source"]["sunlight"] == report["error"]["sunlight_through_layout"]
    assert entry["duality"]["sunlight"] == report["error"]["sunlight_through_regions"]
    assert [row["shown"] for row in rows(folder / "savings.csv")] == ["layout", "duality"]


def test_savings_say_what_is_lost(savings):
    """The layout's own picture is right within its noise; the duality's is not: it lets more sunlight through."""
    entry, = savings[0]["savings"]
    assert abs(entry["source"]["mean_difference"]) < 0.05
    assert entry["duality"]["block_difference"] > 1.5 * entry["source"]["block_difference"]
    assert entry["duality"]["sunlight"]["value"] > 2 * entry["source"]["sunlight"]["value"]


def test_parts_are_refused_that_the_layouts_do_not_allow(tmp_path):
    """A layout of more than three regions stands for the cumulus."""
    nodes = [gltf.ball(f"Puff{i}", (4.0 * i, 0, 0), sigma_s=0.8, sigma_a=0.2, g=0.9) for i in range(4)]
    scene = gltf.scene(tmp_path / "four.gltf", *nodes)
    refuse("study", "--paper", scene, "--tests", "savings", code=2, says=["three regions"])
    refuse("study", "--paper", scene, "--tests", "cumulus", "--gather", "beam", code=2, says=["no beams", "--model physical"])
    refuse("study", "--paper", scene, "--tests", "1", code=2, says=["--tests 1", "none of the layouts"])


# ------------------------------------------------------------------------------------------------------------- manners

def test_bad_inputs_are_refused_in_words(tmp_path):
    empty = gltf.scene(tmp_path / "empty.gltf", {"name": "Nothing"})
    slab = SCENES / "slab.gltf"
    twin = tmp_path / "twin.gltf"
    twin.write_text(ONE.read_text())
    for arguments, code, says in [
        (("study", "--paper"), 2, ["SCENE"]),
        (("study", ONE), 2, ["--paper", "into a folder"]),
        (("study", "--paper", ONE, "--sky", "0.1"), 2, ["--paper", "as they are"]),
        (("study", "--paper", tmp_path / "none.gltf"), 1, ["none.gltf"]),
        (("study", "--paper", empty), 1, ["empty.gltf"]),
        (("study", "--paper", slab), 2, ["slab.gltf", "is no ball"]),
        (("study", "--paper", ONE, twin), 2, ["twin.gltf", "hura2006_1.gltf", "one layout"]),
        (("study", "--paper", ONE, "--tests", "10"), 2, ["10", "cumulus"]),
        (("study", "--paper", ONE, "--tests", "1,x"), 2, ["x", "1 to 9"]),
        (("study", "--paper", ONE, "--tests", "2"), 2, ["--tests 2", "hura2006*.gltf"]),
        (("study", "--paper", ONE, "--seeds", "0"), 2, ["0"]),
        (("study", "--paper", ONE, "--threads", "0"), 2, ["--threads"]),
        (("study", "--paper", ONE, "--gather", "beam"), 2, ["no beams"]),
    ]:
        refuse(*arguments, code=code, says=says, folder=tmp_path)


def test_a_folder_is_written_whole_or_not_at_all(tmp_path):
    quick = ("study", "--paper", THREE, "--tests", "3", "--seeds", 1, "-q")
    folder, file = tmp_path / "out", tmp_path / "file"
    file.write_text("")
    refuse(*quick, "-o", file, says=["is a file"], folder=tmp_path)
    refuse(*quick, "-o", tmp_path / "no" / "out", says=["not there"], folder=tmp_path)
    folder.mkdir()
    (folder / "tests.csv").write_text("mine")
    refuse(*quick, "-o", folder, says=["tests.csv", "--overwrite"], folder=tmp_path)
    assert interrupt("study", "--paper", ONE, "--tests", "7", "-o", tmp_path / "late", after=0.5)[0] == 130
    assert not (tmp_path / "late").exists() and len(listing(tmp_path)) == 2
    succeed(*quick, "-o", folder, "--overwrite")
    assert sorted(path.name for path in folder.iterdir()) == ["savings.csv", "study.json", "test3.png", "tests.csv"]
    assert [row["created_deviation"] for row in rows(folder / "tests.csv")] == [""]


def test_too_thin_a_layout_says_so(tmp_path):
    thin = gltf.scene(tmp_path / "thin.glb", *(gltf.ball(f"Puff{i}", (4.0 * i, 0, 0), sigma_s=1e-6, sigma_a=0.0, g=0) for i in range(3)))
    refuse("study", "--paper", thin, "--tests", "3", says=["thin.glb"], folder=tmp_path)


# ------------------------------------------------------------------------------------------ what accuracy costs in a scene

def test_what_accuracy_costs_goes_on_where_it_was_interrupted(tmp_path):
    """Interrupted and run again, it makes what is missing and nothing twice; the tables are those of the runs."""
    scene, folder = SCENES / "two_spheres.gltf", tmp_path / "study"
    asked = ("study", scene, "-o", folder, "--quick", "--size", "24x18", "--reference", 64)
    lines = folder / "runs.jsonl"
    assert interrupt(*asked, after=1.5)[0] == 130
    before = lines.read_text().splitlines()
    assert 1 < len(before) < 30 and not (folder / "study.csv").exists()
    ran = succeed(*asked, "--json")
    found, after = json.loads(ran.out), lines.read_text().splitlines()
    # Beside three settings of each, voxels of two sizes, an estimate and a step.
    assert after[:len(before)] == before and len(after) == 1 + 2 + 13 * 3 and len(set(after)) == len(after)
    assert [(c["integrator"], c["seeds"]) for c in found["cells"]] == [("path", 3)] * 3 + [("grid", 3)] * 5 + [("photon", 3)] * 5
    changes = [list(c["change"])[0] for c in found["cells"] if c["change"]]
    assert changes == ["voxels", "voxels", "estimate", "step"]
    table = rows(folder / "study.csv")
    assert [float(row["error"]) for row in table] == pytest.approx([max(c["square"], 0) ** 0.5 for c in found["cells"]], abs=1e-5)
    runs = [json.loads(line) for line in after[1:]]
    seconds = sorted(run["seconds"] for run in runs if (run["integrator"], run["work"], run["change"]) == ("grid", 30_000, None))
    assert found["cells"][4]["seconds"] == seconds[1]
    # The path tracer's noise falls about as it must: 432 pixels and three seeds say no more than that.
    assert abs(found["lines"][0]["noise_falls"] + 1.0) < 0.3
    assert (folder / "error.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    page = (folder / "index.html").read_text()
    assert "<svg" in page and page.count("data:image/png;base64,") == 7 and "http" not in page.replace("http://www.w3.org/2000/svg", "")
    # Somebody else's picture: one of its own.
    again = json.loads(succeed(*asked, "--json", "-q", "--against", f"{folder}/pictures/path_64_0.exr:2.5:mine").out)
    assert again["others"][0]["name"] == "mine" and 0.2 < again["others"][0]["error"] / again["cells"][2]["square"] ** 0.5 < 5
    assert lines.read_text().splitlines() == after


def test_a_study_that_cannot_be_says_why(tmp_path):
    scene = SCENES / "two_spheres.gltf"
    taken, dark = tmp_path / "file", tmp_path / "dark"
    taken.write_text("mine")
    small = ("--quick", "--size", "8x6", "--reference", 4, "-q")
    refuse("study", scene, "-o", taken, "--quick", says=["is a file"])
    assert taken.read_text() == "mine"
    refuse("study", scene, "-o", dark, *small, "--irradiance", 0, says=["no pixel of the reference receives light"])
    refuse("study", scene, "-o", dark, *small, says=["holds the study of another scene"])
    refuse("study", scene, "-o", tmp_path / "x", "--against", "c.exr", code=2, says=["is not a picture and its seconds"])


# ------------------------------------------------------------------------------------------------ what the duality changes

def balls_of(path):
    """Centres and radii of a .glb's regions, in its own frame."""
    nodes = [node for node in gltf.read(path)["nodes"] if "extras" in node and "sigma_s" in node["extras"]["cloudvdb"]]
    return np.array([node.get("translation", (0, 0, 0)) for node in nodes]), np.array([node["scale"][0] for node in nodes])


def test_what_the_duality_changes_is_what_its_regions_show(tmp_path):
    """Interrupted, it goes on; and what it says stays uncovered is what points among the main command's own regions say."""
    scene, folder = tmp_path / "ball.glb", tmp_path / "study"
    gltf.scene(scene, gltf.ball("Cloud", (0, 0, 0), radius=2.0, sigma_s=10.0, sigma_a=0.0, g=0.8))
    asked = ("study", scene, "-o", folder, "--duality", "--quick", "--size", "16x12")
    lines = folder / "duality.jsonl"
    assert interrupt(*asked, after=1.0)[0] == 130
    before = lines.read_text().splitlines()
    found, after = json.loads(succeed(*asked, "--json", "-q").out), lines.read_text().splitlines()
    assert after[:len(before)] == before and len(after) == 1 + 12 * 3 and len(set(after)) == len(after)
    assert len(found["cells"]) == 12 and len(rows(folder / "duality.csv")) == 12
    figures = {(c["placement"], c["photons"], c["estimate"], c["layers"]): dict(zip(found["names"], c["figures"])) for c in found["cells"]}
    # Nothing is lost, whatever the photons.
    assert all(f["mass"]["value"] == pytest.approx(1.0, abs=1e-6) for f in figures.values())
    run, = [run for run in map(json.loads, after[1:])
            if (run["placement"], run["photons"], run["estimate"], run["layers"], run["seed"]) == ("uniform", 100_000, None, 1, 0)]
    succeed(scene, "-o", tmp_path / "regions.glb", "--photons", "100k", "--seed", 0)
    centres, radii = balls_of(tmp_path / "regions.glb")
    assert len(centres) == run["regions"]
    points = np.random.default_rng(1).uniform(-2, 2, (100_000, 3))
    points = points[(points ** 2).sum(axis=1) <= 4.0]
    covered = sum((((points - c) ** 2).sum(axis=1) <= r * r).astype(int) for c, r in zip(centres, radii))
    share, stated = (covered == 0).mean(), run["figures"][found["names"].index("uncovered")]
    assert abs(share - stated) < 4.5 * (share * (1 - share) * (1 / len(points) + 1 / 20_000)) ** 0.5
    # Balls at random places leave 1/e at least; two layers the square of what one does, or more.
    one, two, four = (figures["uniform", 100_000, None, layers]["uncovered"] for layers in (1, 2, 4))
    assert one["value"] > np.exp(-1) - 4.5 * one["se"]
    assert four["value"] < two["value"] < one["value"] and two["value"] > one["value"] ** 2 - 4.5 * (two["se"] + one["se"])
    page = (folder / "duality.html").read_text()
    assert "<svg" in page and page.count("data:image/png;base64,") == 3 and "http" not in page.replace("http://www.w3.org/2000/svg", "")


def test_a_study_of_the_duality_that_cannot_be_says_why(tmp_path):
    refuse("study", SCENES / "slab.gltf", "-o", tmp_path / "x", "--duality", "--quick", says=["without end"], folder=tmp_path)
    refuse("study", SCENES / "two_spheres.gltf", "--duality", code=2, says=["into a folder"])
    refuse("study", SCENES / "two_spheres.gltf", "-o", tmp_path / "x", "--duality", "--reference", 8, code=2, says=["--duality"], folder=tmp_path)
