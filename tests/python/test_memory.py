"""Photons are stored whole: more of them than memory are refused in words before any is traced, and what the words count is what they take."""
import json

import pytest

from command import SCENES, free_memory, refuse, succeed

ONE, CUMULUS = SCENES / "hura2006_1.gltf", SCENES / "cumulus.gltf"
# What is said that a photon takes, bytes.
EACH = 47


@pytest.mark.parametrize("job, says", [
    (["-o", "a.vdb"], ["--density source with --integrator grid"]),
    (["--json"], ["--density source with --integrator grid"]),
    (["--density", "source", "--integrator", "photon", "-o", "a.exr"], ["or --integrator grid"]),
])
def test_more_photons_than_memory_are_refused_before_the_work(tmp_path, job, says):
    ran = refuse(CUMULUS, *job, "--photons", "400M", "--memory", "2G", cwd=tmp_path, folder=tmp_path,
                 says=["--photons 400000000 takes 18800.0 MB", "--memory is 2000.0 MB", f"--photons {2_000_000_000 // EACH} or fewer", *says])
    assert ran.seconds < 2.0


def test_photons_that_are_not_stored_take_no_memory(tmp_path):
    """By the grid integrator and by paths, of the layout itself."""
    for flags in (["--integrator", "grid", "--picture-photons", "10k"], ["--integrator", "path"]):
        succeed(CUMULUS, "--density", "source", *flags, "--photons", "400M", "--memory", "2G", "--size", "8x6", "--spp", "1", "-q", "-o", tmp_path / "a.exr",
                "--overwrite")
    succeed(CUMULUS, "--photons", "400M", "--memory", "2G", "--dry-run", "-q")


def test_without_a_limit_it_is_what_the_system_has():
    if 4294967295 * EACH < free_memory():
        pytest.skip("there is memory for as many photons as can be asked for")
    ran = refuse(CUMULUS, "--json", "--photons", "4294967295", says=["--photons 4294967295 takes 201863.5 MB", "are free", "more --memory"])
    told = float(ran.err.split("holds, and ")[1].split()[0])
    assert told == pytest.approx(free_memory() / 1e6, rel=0.2) and ran.seconds < 2.0


@pytest.mark.parametrize("job", [[ONE], [CUMULUS, "--density", "source", "--integrator", "photon", "--size", "8x6", "--spp", "1", "-o", "a.png", "--overwrite"]])
def test_a_photon_takes_what_is_said(tmp_path, job):
    """By the peaks of runs that differ in photons: of one region, whose tree holds them all, and of a picture by stored photons."""
    few, many = (json.loads(succeed(*job, "--photons", n, "--json", "-q", cwd=tmp_path).out)["peak_memory"] for n in ("2M", "6M"))
    # What waves of photons hold beside the map comes and goes: a few megabytes.
    assert 0.8 * EACH < (many - few) / 4e6 < 1.1 * EACH
