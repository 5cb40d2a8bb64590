"""Two classical segmenters of nuclei and how they are scored: shared by the scripts beside it.

Needs numpy and scipy.
"""

import numpy as np
from scipy import ndimage


def absorbance(image):
    """Decadic absorbance, with the empty slide estimated by the bright parts around each pixel."""
    light = np.maximum(image.astype(np.float32), 1)
    glass = ndimage.gaussian_filter(ndimage.maximum_filter(ndimage.gaussian_filter(light, 2), 61), 30)
    return np.log10(np.maximum(glass / light, 1e-3))


def otsu(values):
    """The threshold that parts values into the two classes that differ most (Otsu 1979)."""
    counts, edges = np.histogram(values, 256)
    middles = (edges[:-1] + edges[1:]) / 2
    below, above = np.cumsum(counts), np.cumsum(counts[::-1])[::-1]
    mean_below = np.cumsum(counts * middles) / np.maximum(below, 1)
    mean_above = (np.cumsum((counts * middles)[::-1]) / np.maximum(np.cumsum(counts[::-1]), 1))[::-1]
    between = below[:-1] * above[1:] * (mean_below[:-1] - mean_above[1:]) ** 2
    return middles[np.argmax(between)]


def parts(mask, least_px, most_px):
    """Connected parts of a mask whose size is that of a nucleus."""
    labels, count = ndimage.label(ndimage.binary_fill_holes(ndimage.binary_opening(mask, iterations=2)))
    sizes = ndimage.sum_labels(np.ones_like(labels), labels, np.arange(count + 1))
    fits = (sizes >= least_px) & (sizes <= most_px)
    fits[0] = False
    numbers = np.cumsum(fits) * fits
    return numbers[labels]


def by_threshold(image, pixel_um):
    """What is darker than Otsu's threshold within the cells."""
    dark = ndimage.gaussian_filter(absorbance(image), 1)
    cells = dark > otsu(dark)
    return parts(cells & (dark > otsu(dark[cells])), 12 / pixel_um**2, 400 / pixel_um**2)


def by_contrast(image, pixel_um):
    """What is darker than what lies around it, at the scale of a nucleus."""
    dark = absorbance(image)
    small, large = (ndimage.gaussian_filter(dark, sigma / pixel_um) for sigma in (0.6, 6.0))
    return parts(small - large > 0.06, 12 / pixel_um**2, 400 / pixel_um**2)


def truth_of(frame):
    """Complete masks of the nuclei that are large enough to count."""
    nuclei = (frame.table["part"] == "nucleus") & (frame.table["area_um2"] >= 12)
    return frame.masks[nuclei]


def score(found, masks):
    """True positives, false positives and false negatives: a nucleus is found if a part shares half of their union with it."""
    hits, taken = 0, set()
    for mask in masks:
        numbers, counts = np.unique(found[mask], return_counts=True)
        for number in numbers[np.argsort(-counts)]:
            if number and number not in taken:
                part = found == number
                if (part & mask).sum() >= 0.5 * (part | mask).sum():
                    hits += 1
                    taken.add(number)
                break
    return np.array([hits, found.max() - hits, len(masks) - hits])


def f1(counts):
    hits, wrong, missed = counts
    return 2 * hits / max(2 * hits + wrong + missed, 1)
