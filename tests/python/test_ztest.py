"""The comparison of pictures accepts equal ones, and sees a bias of 1 %, half a pixel, a wrong variance."""
import math

import numpy as np
import pytest

import ztest
from ztest import Picture, compare

H, W = 48, 64
Y, X = np.mgrid[0:H, 0:W].astype(float)
BRIGHT = 0.2 + 0.01 * X


def truth(shift=0.0):
    """A lit ball with a soft edge before a black sky, brighter on one side."""
    return np.clip((18.0 - np.hypot(X - 31.3 - shift, Y - 23.1)) / 2.0, 0, 1) * BRIGHT


def heavy(rng, image, samples):
    """The mean of `samples` a pixel of something like radiance along paths: most bring nothing, and what the others bring
    has an exponential tail. At the edge fewer hit. Sums of exponentials are gammas."""
    rate = 0.1 * np.minimum(image / BRIGHT, 1.0)
    hits = rng.poisson(samples * rate)
    return np.where(hits > 0, image * rng.gamma(np.maximum(hits, 1)) / np.maximum(samples * rate, 1e-9), 0.0)


def seeds(rng, image, count=8, samples=64):
    return [heavy(rng, image, samples) for _ in range(count)]


def stated(rng, image, samples=512, factor=1.0):
    """With standard errors from its own samples, which are noisy and go along with the mean."""
    parts = np.array([heavy(rng, image, samples // 32) for _ in range(32)])
    return Picture.from_error(parts.mean(axis=0), factor * parts.std(axis=0, ddof=1) / math.sqrt(32))


def test_distributions():
    """Against tables."""
    assert ztest.normal_tail(1.959964) == pytest.approx(0.05, rel=1e-5)
    assert ztest.student_tail(2.228139, 10) == pytest.approx(0.05, rel=1e-5)
    assert ztest.student_tail(0.5, 3) == pytest.approx(0.651448, rel=1e-4)
    assert ztest.student_bound(0.001, 5) == pytest.approx(6.868827, rel=1e-4)
    assert ztest.normal_tail(ztest.chi_squared_z(124.342, 100)) / 2 == pytest.approx(0.05, rel=0.01)
    assert ztest.poisson_bound(1.0, 0.02) == 3


@pytest.mark.parametrize("kind", ["seeds and seeds", "seeds and errors"])
def test_equal_pictures_pass(tmp_path, kind):
    """60 pairs with heavy tails: at the stated level none should fail, and mean Z^2 is 1 for every block size."""
    rng = np.random.default_rng(5)
    verdicts = []
    for i in range(60):
        ours = Picture.from_seeds(seeds(rng, truth())) if kind == "seeds and seeds" else stated(rng, truth())
        verdicts.append(compare(ours, Picture.from_seeds(seeds(rng, truth())), f"{i}", folder=tmp_path))
    failed = [str(v) for v in verdicts if not v.agree]
    assert len(failed) <= 1, "\n".join(failed)
    for size in ztest.SIZES:
        assert np.mean([v.chi_squared[size] for v in verdicts]) == pytest.approx(1.0, abs=0.05)
    assert np.std([v.mean_z for v in verdicts]) == pytest.approx(1.0, abs=0.25)


def test_the_level_is_what_it_says(tmp_path):
    """At a hundred times the level, failures are as rare as that allows, and not absent either: the tests have power."""
    rng = np.random.default_rng(6)
    failed = sum(not compare(Picture.from_seeds(seeds(rng, truth())), Picture.from_seeds(seeds(rng, truth())), "level",
                             folder=tmp_path, alpha=1e-2).agree for _ in range(100))
    assert 1 <= failed <= 22


@pytest.mark.parametrize("fault, says", [
    ("bias", "means differ"), ("shift", "Z^2"), ("patch", "blocks of"), ("firefly", "|Z| is"),
    ("errors too small", "Z^2"), ("errors too large", "Z^2"), ("not finite", "not finite"), ("sky", "without noise")])
def test_faults_are_seen(tmp_path, fault, says):
    rng = np.random.default_rng(12)
    image, factor = truth(), 1.0
    if fault == "bias":
        image = image * 1.01
    if fault == "shift":
        image = truth(1.0)
    if fault == "patch":
        image[16:24, 24:32] *= 1.06
    if fault.startswith("errors"):
        factor = 0.75 if "small" in fault else 1.33
    ours = stated(rng, image, samples=16384, factor=factor)
    if fault == "firefly":
        ours.mean[20, 30] *= 2.0
    if fault == "not finite":
        ours.mean[20, 30] = np.nan
    if fault == "sky":
        ours.mean[0, 0] = 0.01
    verdict = compare(ours, Picture.from_seeds(seeds(rng, truth(), samples=2048)), fault, folder=tmp_path)
    assert any(says in complaint for complaint in verdict.complaints), verdict
    # What failed can be looked at.
    for name in ("ours.png", "theirs.png", "difference.png", "p_1.png", "p_8.npy", "ours.npy"):
        assert (verdict.dumped / name).stat().st_size > 0
    assert str(verdict.dumped) in str(verdict)


def test_a_tolerance_allows_what_it_says(tmp_path):
    rng = np.random.default_rng(8)
    theirs = Picture.from_seeds(seeds(rng, truth(), samples=4096))
    assert compare(stated(rng, 1.01 * truth(), samples=32768), theirs, "1 %", tolerance=0.01, folder=tmp_path).agree
    assert not compare(stated(rng, 1.08 * truth(), samples=32768), theirs, "8 %", tolerance=0.01, folder=tmp_path).agree


def test_one_seed_twice_is_refused():
    image = heavy(np.random.default_rng(9), truth(), 64)
    with pytest.raises(ValueError, match="same picture"):
        Picture.from_seeds([image, *seeds(np.random.default_rng(10), truth()), image])


def test_stated_errors_are_judged():
    rng = np.random.default_rng(11)
    ours = [stated(rng, truth()) for _ in range(16)]
    images, errors = [p.mean for p in ours], [np.sqrt(p.variance) for p in ours]
    ratio, error = ztest.stated_errors(errors, images)
    assert abs(ratio - 1.0) < 3.5 * error and error < 0.02
    ratio, error = ztest.stated_errors([0.9 * e for e in errors], images)
    assert ratio - 1.0 > 5 * error
