"""Do two noisy pictures show the same thing? Z scores with both variances, and what may be concluded from them.

A picture is a mean and the variance of that mean, a pixel. A renderer that gives its standard
errors needs one picture, any other several seeds (8 to 16). Radiance along single paths has heavy tails, and a variance
from a few of them is low exactly where the mean is low. So variances are pooled over neighbours that are alike, in
proportion to the mean (light that few paths bring has a variance proportional to its mean), and every bound takes tails
as heavy as the seeds show them.
"""
import dataclasses
import math
import pathlib
import struct
import tempfile
import zlib

import numpy as np

SIZES = (1, 2, 4, 8)
# Of one test; a verdict has three a block size and one of the mean, so 1 in 1,000 verdicts on equal pictures says no.
ALPHA = 1e-4


# ------------------------------------------------------------------------------------------------------------ pictures

def blocks(image, size):
    """Means over size x size pixels; what is left over at the right and the bottom is left out."""
    h, w = (n // size * size for n in image.shape[:2])
    return image[:h, :w].reshape(h // size, size, w // size, size, *image.shape[2:]).mean(axis=(1, 3))


def around(image, reach=1):
    """The sum over the neighbourhood of each pixel, smaller at the border."""
    padded = np.pad(image, reach)
    n = 2 * reach + 1
    return sum(padded[i:i + image.shape[0], j:j + image.shape[1]] for i in range(n) for j in range(n))


def grey(image):
    """One number a pixel: the mean of the channels."""
    image = np.asarray(image, np.float64)
    return image.mean(axis=2) if image.ndim == 3 else image


@dataclasses.dataclass
class Picture:
    mean: np.ndarray
    # Of each pixel's mean, as measured: not yet pooled. Pixels are independent of each other.
    variance: np.ndarray
    # Excess kurtosis of a pixel's mean about its truth.
    kurtosis: float = 0.0

    @classmethod
    def from_seeds(cls, images):
        """Of independent renders."""
        stack = np.array([grey(image) for image in images])
        k = len(stack)
        if k < 4:
            raise ValueError(f"{k} seeds give no variance; 8 or more do")
        if any(np.array_equal(stack[i], stack[j]) and stack[i].std() > 0 for i in range(k) for j in range(i)):
            raise ValueError("two seeds gave the same picture: no independent renders")
        mean, variance = stack.mean(axis=0), stack.var(axis=0, ddof=1) / k
        spread = np.sqrt(pooled(variance, mean) * (k - 1))
        seen = spread > 0
        residual = ((stack - mean) / np.where(seen, spread, 1.0))[:, seen]
        # Of one seed's residual; the mean of k has a k-th.
        heavy = (residual ** 4).mean() / (residual ** 2).mean() ** 2 - 3.0 if seen.any() else 0.0
        return cls(mean, variance, max(0.0, float(heavy)) / k)

    def no_better_than(self, other, samples):
        """This picture with at least the variance of `other`, a renderer that needs no more samples for it and took
        `samples` times as many. Seeds that all missed the rare bright paths of a pixel are too low and too sure at once."""
        floor = pooled(np.nan_to_num(other.variance), np.abs(other.mean)) * samples
        return dataclasses.replace(self, variance=np.maximum(self.variance, floor))

    @classmethod
    def from_error(cls, mean, error, kurtosis=0.0):
        """Of a renderer that gives a standard error a pixel. Colours of one path are taken as wholly correlated, which
        they are where the medium is grey."""
        return cls(grey(mean), grey(error) ** 2, kurtosis)


def pooled(variance, mean):
    """The variance with its neighbours' help, in proportion to the mean, where neighbours are alike.

    A pixel's own figure, from a few seeds, is itself noisy; its neighbours' is another thing at an edge. The logarithms
    of variance over mean scatter about as much within most neighbourhoods as noise alone makes them; where they scatter
    more, a pixel's own figure gets the weight of what is more (empirical Bayes).
    """
    mean = np.abs(mean)
    # A bright pixel that never varies (sky) has no noise and says nothing of its neighbours'.
    still = (variance <= 1e-12 * mean ** 2) & (mean > 0) & (around(variance == 0) > 0)
    noisy = (variance > 1e-12 * mean ** 2) & (mean > 0)
    total, count = around(np.where(noisy, mean, 0.0)), around(noisy.astype(float))
    shared = np.divide(around(np.where(noisy, variance, 0.0)), total, out=np.zeros_like(mean), where=total > 0)
    log = np.log(np.where(noisy, variance, 1.0) / np.where(noisy, mean, 1.0))
    first, second = (np.divide(around(np.where(noisy, log ** k, 0.0)), count, out=np.zeros_like(mean), where=count > 0) for k in (1, 2))
    scatter = second - first ** 2
    usable = noisy & (count >= 4)
    usual = 1.5 * np.quantile(scatter[usable], 0.25) if usable.any() else 0.0
    own = np.where(usable, np.clip(1.0 - usual / np.maximum(scatter, 1e-12), 0.0, 1.0), 0.0)
    out = mean * np.exp(own * log + (1.0 - own) * np.log(np.maximum(shared, 1e-300)))
    return np.where(still | (mean == 0) | (shared == 0), 0.0, out)


# ---------------------------------------------------------------------------------------------------- distributions

def normal_tail(z):
    """Of |Z| > z."""
    return math.erfc(abs(z) / math.sqrt(2.0))


def student_tail(t, freedom):
    """Of |T| > t with `freedom` degrees: the incomplete beta function, by its continued fraction (Lentz)."""
    if not math.isfinite(freedom) or freedom > 1e6:
        return normal_tail(t)
    x = freedom / (freedom + t * t)
    a, b = freedom / 2.0, 0.5
    if x >= 1.0:
        return 1.0
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x))
    return front * _fraction(x, a, b) / a if x < (a + 1) / (a + b + 2) else 1.0 - front * _fraction(1 - x, b, a) / b


def _fraction(x, a, b):
    tiny = 1e-300
    c, d = 1.0, 1.0 - (a + b) * x / (a + 1)
    d = 1.0 / (d if abs(d) > tiny else tiny)
    out = d
    for m in range(1, 500):
        for top in (m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
                    -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))):
            d = 1.0 + top * d
            d = 1.0 / (d if abs(d) > tiny else tiny)
            c = 1.0 + top / c
            c = c if abs(c) > tiny else tiny
            out *= c * d
        if abs(c * d - 1.0) < 1e-12:
            break
    return out


def student_bound(p, freedom):
    """t such that |T| > t has probability p."""
    low, high = 0.0, 1e6
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if student_tail(middle, freedom) > p else (low, middle)
    return high


def chi_squared_z(total, freedom):
    """A chi-squared sum as a normal score (Wilson and Hilferty 1931): good to some percent of its p far into the tails."""
    return ((total / freedom) ** (1 / 3) - (1 - 2 / (9 * freedom))) / math.sqrt(2 / (9 * freedom))


def poisson_bound(mean, p):
    """The least n such that more than n have a probability below p."""
    n, term, below = 0, math.exp(-mean), math.exp(-mean)
    while 1.0 - below > p:
        n += 1
        term *= mean / n
        below += term
        if n > 10 * mean + 100:
            break
    return n


# ---------------------------------------------------------------------------------------------------------- verdict

@dataclasses.dataclass
class Verdict:
    """What was found. `complaints` is empty where the pictures agree."""
    name: str
    ratio: float                # of the means, ours over theirs
    error: float                # of that ratio
    mean_z: float
    chi_squared: dict           # {block size: mean of Z squared}
    complaints: list
    dumped: pathlib.Path = None

    @property
    def agree(self):
        return not self.complaints

    def __str__(self):
        shown = ", ".join(f"{size}: {value:.3f}" for size, value in self.chi_squared.items())
        head = f"{self.name}: mean x {self.ratio:.5f} +- {self.error:.5f} (Z {self.mean_z:+.2f}), Z^2 by block {{{shown}}}"
        tail = [f"pictures and numbers are in {self.dumped}"] if self.dumped else []
        return "\n  ".join([head, *self.complaints, *tail])


def compare(ours, theirs, name="pictures", tolerance=0.0, folder=None, alpha=ALPHA, skip=None):
    """Judges two pictures. `tolerance` is how far theirs may be off systematically, as a part of the radiance;
    pixels in `skip` are not judged.

    Three questions at every block size, one of the whole: is the sum of Z^2 what chi-squared allows (and, for
    pixels, not less: a stated error that is too large is as wrong as one too small)? Are there more |Z| beyond the 1 % point than Poisson allows? Is
    the largest |Z| within Bonferroni's bound? Is the mean of the whole the same?
    """
    if ours.mean.shape != theirs.mean.shape:
        raise ValueError(f"pictures of {ours.mean.shape} and {theirs.mean.shape}")
    complaints, squares, maps = [], {}, {}
    bad = int((~np.isfinite(ours.mean)).sum()), int((~np.isfinite(theirs.mean)).sum())
    if any(bad):
        complaints.append(f"{bad[0]} and {bad[1]} pixels are not finite")
    mean = np.where(np.isfinite(ours.mean + theirs.mean), (ours.mean + theirs.mean) / 2, 0.0)
    difference = np.where(np.isfinite(ours.mean - theirs.mean), ours.mean - theirs.mean, 0.0)
    both = [pooled(np.nan_to_num(picture.variance), mean) for picture in (ours, theirs)]
    if skip is not None:
        difference, both = np.where(skip, 0.0, difference), [np.where(skip, 0.0, variance) for variance in both]
    for size in SIZES:
        level, gap = blocks(mean, size), blocks(difference, size)
        variance = blocks(both[0] + both[1], size) / size ** 2 + (tolerance * level) ** 2
        # Where both know their value (black sky, white sky) there is no noise to judge by: then they must be equal.
        known = variance <= (1e-6 * np.abs(mean).max()) ** 2
        slack = 1e-4 * np.abs(level[known]) + 1e-6 * np.abs(mean).max() + 5.0 * np.sqrt(variance[known])
        off = np.abs(gap[known]) > slack
        if off.any():
            complaints.append(f"blocks of {size}: {off.sum()} of {known.sum()} without noise differ")
        z = np.where(known, 0.0, gap / np.sqrt(np.where(known, 1.0, variance)))
        maps[size] = z
        seen = z[~known]
        n = seen.size
        if n < 4:
            continue
        heavy = max(ours.kurtosis, theirs.kurtosis) / size ** 2
        freedom = 4.0 + 6.0 / heavy if heavy > 1e-3 else math.inf
        # Heavy tails widen the sum of Z^2: scaled and with fewer degrees of freedom (Satterthwaite).
        observed = np.clip(seen ** 2, None, 25.0)
        spread = max(1.0, 1.0 + heavy / 2.0, observed.var() / (2.0 * observed.mean() ** 2))
        squares[size] = float((seen ** 2).mean())
        score = chi_squared_z((seen ** 2).sum() / spread, n / spread)
        p = normal_tail(score)
        # Too small is judged by single pixels alone: samplers may make neighbours err in opposite ways. A tolerance makes
        # the variance too large where it is not used up.
        if p < alpha and (score > 0 or size == 1 and tolerance == 0):
            complaints.append(f"blocks of {size}: mean Z^2 is {squares[size]:.3f} over {n} (p {p:.1e})")
        allowed = poisson_bound(0.01 * n * spread, alpha) if n >= 100 else n
        limit = student_bound(0.01, freedom)
        beyond = int((np.abs(seen) > limit).sum())
        if beyond > allowed:
            complaints.append(f"blocks of {size}: {beyond} of {n} have |Z| above {limit:.2f}, {allowed} may")
        limit, largest = student_bound(alpha / n, freedom), float(np.abs(seen).max())
        if largest > limit:
            at = tuple(int(i) * size for i in np.unravel_index(np.abs(z).argmax(), z.shape))
            complaints.append(f"blocks of {size}: |Z| is {largest:.1f} at row {at[0]}, column {at[1]}; {limit:.1f} may be")
    # The whole.
    truth, gap = float(np.nanmean(theirs.mean)), float(difference.mean())
    error = math.sqrt((both[0] + both[1]).sum()) / mean.size
    scale = math.hypot(error, tolerance * abs(truth))
    mean_z = gap / scale if scale > 0 else 0.0 if abs(gap) <= 1e-5 * abs(truth) else math.inf
    ratio = 1.0 + gap / truth if truth else math.nan
    if not normal_tail(mean_z) > alpha:
        complaints.append(f"the means differ: Z is {mean_z:+.1f}")
    verdict = Verdict(name, ratio, error / truth if truth else math.nan, mean_z, squares, complaints)
    if complaints:
        verdict.dumped = dump(ours, theirs, maps, name, folder)
    return verdict


def rim(picture):
    """The pixels that a shape before an even sky covers in part: those beside one without any noise.

    Cycles places the samples of a pixel alike for every seed. What that leaves of the shape's share of a pixel is no
    noise between seeds, and where all else is nearly even it is all there is to see.
    """
    still = picture.variance <= 1e-12 * picture.mean ** 2
    return ~still & (around(still) > 0)


def stated_errors(stated, images, shared=False):
    """Are a renderer's own standard errors true? Judged by how its seeds scatter: (ratio of variances, its standard
    error). `stated` are the error pictures of the seeds, `images` the seeds. Where pixels share their variance with those
    around them, as the path tracer's do, only sums of variances are told."""
    images = np.array([grey(image) for image in images])
    k = len(images)
    claimed = (np.array([grey(error) for error in stated]) ** 2).mean(axis=0)
    shown = images.var(axis=0, ddof=1)
    # Weighed so that every pixel counts alike, unless they share; its scatter says how well the ratio is known.
    weight = np.ones_like(claimed) if shared else 1.0 / np.maximum(pooled(claimed, images.mean(axis=0)), 1e-30)
    use = claimed > 0
    claims, shows = (claimed * weight)[use], (shown * weight)[use]
    ratio = shows.sum() / claims.sum()
    error = np.sqrt(((shows - ratio * claims) ** 2).sum()) / claims.sum()
    return float(ratio), float(error)


# ------------------------------------------------------------------------------------------------------------ dumps

def png(path, rgb):
    """Writes height x width x 3 in [0, 1]."""
    pixels = (np.clip(np.nan_to_num(rgb), 0, 1) * 255 + 0.5).astype(np.uint8)
    h, w = pixels.shape[:2]
    raw = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    pathlib.Path(path).write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, 8, 2, 0, 0, 0))
                                   + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def enlarged(image, least=384):
    return image.repeat(max(1, least // image.shape[1]), axis=0).repeat(max(1, least // image.shape[1]), axis=1)


def signed(x):
    """Red above, blue below, white at 0."""
    x = np.clip(np.nan_to_num(x), -1, 1)[..., None]
    return np.where(x > 0, 1 - x * [0.15, 0.85, 0.85], 1 + x * [0.85, 0.6, 0.15])


def dump(ours, theirs, maps, name, folder=None):
    """Ours, theirs, difference, Z and p by block size: .png to look at, .npy to compute with. Returns the folder."""
    folder = pathlib.Path(folder) if folder else pathlib.Path(tempfile.mkdtemp(prefix="ztest-"))
    folder = folder / "".join(c if c.isalnum() or c in "-_." else "_" for c in name)
    folder.mkdir(parents=True, exist_ok=True)
    top = np.nanpercentile(theirs.mean, 99) or 1.0
    for label, picture in (("ours", ours), ("theirs", theirs)):
        np.save(folder / f"{label}.npy", picture.mean)
        np.save(folder / f"{label}_variance.npy", picture.variance)
        png(folder / f"{label}.png", enlarged(np.clip(picture.mean / top, 0, 1)[..., None].repeat(3, axis=2) ** (1 / 2.2)))
    np.save(folder / "difference.npy", ours.mean - theirs.mean)
    png(folder / "difference.png", enlarged(signed((ours.mean - theirs.mean) / (0.2 * top))))
    for size, z in maps.items():
        p = np.vectorize(normal_tail)(z)
        np.save(folder / f"z_{size}.npy", z)
        np.save(folder / f"p_{size}.npy", p)
        # Colour is -log10 p with the sign of the difference: full at 1e-6.
        png(folder / f"p_{size}.png", enlarged(signed(np.sign(z) * -np.log10(np.maximum(p, 1e-300)) / 6)))
    return folder
