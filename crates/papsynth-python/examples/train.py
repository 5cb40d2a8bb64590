"""Trains a nucleus segmenter on synthetic fields and scores it on other synthetic fields and on real ones.

Usage: python train.py [FOLDER]

FOLDER contains real fields as PNG, each with a CSV file of the same name: a line `y,x` for the centre of each nucleus.
Needs numpy, scipy, scikit-learn and Pillow.
"""

import csv
import sys
from pathlib import Path

import numpy as np
import papsynth
from scipy import ndimage
from segmenters import absorbance, f1, parts, score, truth_of
from sklearn.ensemble import RandomForestClassifier

PIXEL_UM = 0.33
RECIPE = {"field": {"width_px": 512, "height_px": 384, "pixel_um": PIXEL_UM, "magnification": 0.0}}
TRAINING, TESTING, REAL = 12, 4, 8
PIXELS_A_FIELD = 3000


def features(image):
    """Return features of each pixel at several scales."""
    dark = absorbance(image)
    blurred = [ndimage.gaussian_filter(dark, sigma) for sigma in (0.7, 1.5, 3, 6, 12)]
    edges = [np.hypot(ndimage.sobel(layer, 0), ndimage.sobel(layer, 1)) for layer in blurred[:3]]
    rings = [fine - coarse for fine, coarse in zip(blurred, blurred[2:])]
    return np.stack([*blurred, *edges, *rings], axis=-1)


def train():
    samples = papsynth.Dataset(RECIPE, seed=1, length=TRAINING)
    random = np.random.default_rng(0)
    inputs, targets = [], []
    for frame in samples:
        inside = frame.masks[frame.table["part"] == "nucleus"].any(axis=0)
        # Equal numbers of pixels inside and outside nuclei.
        for wanted in (inside, ~inside):
            places = np.flatnonzero(wanted)
            places = random.choice(places, min(PIXELS_A_FIELD // 2, len(places)), replace=False)
            inputs.append(features(frame.image).reshape(inside.size, -1)[places])
            targets.append(inside.ravel()[places])
    forest = RandomForestClassifier(40, max_depth=14, min_samples_leaf=4, n_jobs=-1, random_state=0)
    return forest.fit(np.concatenate(inputs), np.concatenate(targets))


def segment(forest, image):
    values = features(image)
    inside = forest.predict_proba(values.reshape(-1, values.shape[-1]))[:, 1].reshape(image.shape)
    return parts(ndimage.gaussian_filter(inside, 1) > 0.7, 12 / PIXEL_UM**2, 400 / PIXEL_UM**2)


def on_synthetic(forest):
    counts = np.zeros(3, dtype=int)
    for frame in papsynth.Dataset(RECIPE, seed=2, length=TESTING):
        counts += score(segment(forest, frame.image), truth_of(frame))
    return counts


def on_real(forest, folder):
    """Score real fields: a nucleus is found if its centre is in a segment of its own."""
    from PIL import Image

    counts = np.zeros(3, dtype=int)
    for path in sorted(folder.glob("*.png"))[:REAL]:
        table = path.with_suffix(".csv")
        if not table.exists():
            continue
        image = np.asarray(Image.open(path).convert("L"))
        found = segment(forest, image)
        with table.open() as file:
            middles = [(int(float(y)), int(float(x))) for y, x in csv.reader(file)]
        rows, columns = image.shape
        at = [found[y, x] for y, x in middles if 0 <= y < rows and 0 <= x < columns]
        hits = len({number for number in at if number})
        counts += (hits, found.max() - hits, len(at) - hits)
    return counts


def main(folder=None):
    forest = train()
    synthetic = f1(on_synthetic(forest))
    print(f"other synthetic fields: F1 {synthetic:.2f}")
    real = None
    if folder is None:
        print("real fields: not scored, no folder given")
    else:
        counts = on_real(forest, Path(folder))
        real = f1(counts)
        print(f"real fields: F1 {real:.2f} (found {counts[0]}, wrong {counts[1]}, missed {counts[2]})")
    return synthetic, real


if __name__ == "__main__":
    main(*sys.argv[1:2])
