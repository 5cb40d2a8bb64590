"""Two classical nucleus segmenters and their scores, used by the other scripts.

Needs numpy and scipy.
"""

import numpy as np
from scipy import ndimage


def absorbance(image):
    """Return the decadic absorbance. The light of the empty slide is estimated from bright pixels nearby."""
    light = np.maximum(image.astype(np.float32), 1)
    glass = ndimage.gaussian_filter(ndimage.maximum_filter(ndimage.gaussian_filter(light, 2), 61), 30)
    return np.log10(np.maximum(glass / light, 1e-3))


def otsu(values):
    """Return the threshold that maximises the between-class variance (Otsu 1979)."""
    counts, edges = np.histogram(values, 256)
    middles = (edges[:-1] + edges[1:]) / 2
    below, above = np.cumsum(counts), np.cumsum(counts[::-1])[::-1]
    mean_below = np.cumsum(counts * middles) / np.maximum(below, 1)
    mean_above = (np.cumsum((counts * middles)[::-1]) / np.maximum(np.cumsum(counts[::-1]), 1))[::-1]
    between = below[:-1] * above[1:] * (mean_below[:-1] - mean_above[1:]) ** 2
    return middles[np.argmax(between)]


def parts(mask, least_px, most_px):
    """Return the connected components of a mask that are as large as nuclei."""
    labels, count = ndimage.label(ndimage.binary_fill_holes(ndimage.binary_opening(mask, iterations=2)))
    sizes = ndimage.sum_labels(np.ones_like(labels), labels, np.arange(count + 1))
    fits = (sizes >= least_px) & (sizes <= most_px)
    fits[0] = False
    numbers = np.cumsum(fits) * fits
    return numbers[labels]


def by_threshold(image, pixel_um):
    """Segment pixels darker than Otsu's threshold within the cells."""
    dark = ndimage.gaussian_filter(absorbance(image), 1)
    cells = dark > otsu(dark)
    return parts(cells & (dark > otsu(dark[cells])), 12 / pixel_um**2, 400 / pixel_um**2)


def by_contrast(image, pixel_um):
    """Segment pixels darker than their surroundings, by a difference of Gaussians."""
    dark = absorbance(image)
    small, large = (ndimage.gaussian_filter(dark, sigma / pixel_um) for sigma in (0.6, 6.0))
    return parts(small - large > 0.06, 12 / pixel_um**2, 400 / pixel_um**2)


def truth_of(frame):
    """Return the complete masks of all nuclei of 12 µm² or more."""
    nuclei = (frame.table["part"] == "nucleus") & (frame.table["area_um2"] >= 12)
    return frame.masks[nuclei]


def score(found, masks):
    """Return true positives, false positives and false negatives at an intersection over union of 0.5."""
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
