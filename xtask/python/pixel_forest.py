"""Trains a random forest on pixels of synthetic fields, and segments the nuclei of a real field.

    pixel_forest.py SYNTHETIC IMAGE MASK [--fields 20]

SYNTHETIC is a data set of `papsynth generate`; IMAGE a real field, MASK its nuclei. A forest of 100 trees classifies
pixels of the first fields by Gaussian, Hessian and Sobel features at sigma 1 to 8. The probability threshold is the one
with the best Dice coefficient on the other fields of the data set. Prints one line of JSON.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from PIL import Image
from pycocotools import mask as rle
from scipy import ndimage
from sklearn.ensemble import RandomForestClassifier

SIGMAS = (1, 2, 4, 8)
PIXELS = 4000  # of each field, half of them in nuclei
SEED = 0


def features(grey):
    """Return the features of every pixel.

    They are the absorbance relative to the background, blurred, its gradients, and the eigenvalues of the Hessian.
    """
    background = max(np.percentile(grey, 95), 1.0)
    image = -np.log10(np.clip(grey, 1.0, None) / background).astype(np.float32)
    columns = [image]
    for sigma in SIGMAS:
        smooth = ndimage.gaussian_filter(image, sigma)
        columns.append(smooth)
        columns.append(np.hypot(ndimage.sobel(smooth, 0), ndimage.sobel(smooth, 1)))
        yy, xx, xy = (ndimage.gaussian_filter(image, sigma, order=order) for order in ((2, 0), (0, 2), (1, 1)))
        root = np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
        columns += [(xx + yy) / 2 + root, (xx + yy) / 2 - root]
    return np.stack(columns, axis=-1).reshape(image.size, -1)


def synthetic(folder):
    """Return the fields of a data set, each with the mask of its nuclei."""
    coco = json.loads((folder / "coco.json").read_text())
    names = {category["id"]: category["name"] for category in coco["categories"]}
    fields = {}
    for image in sorted(coco["images"], key=lambda image: image["id"]):
        grey = np.asarray(Image.open(folder / image["file_name"]).convert("L"), dtype=np.float32)
        fields[image["id"]] = (grey, np.zeros(grey.shape, bool))
    for annotation in coco["annotations"]:
        if "nucleus" in names[annotation["category_id"]]:
            nuclei = fields[annotation["image_id"]][1]
            nuclei |= rle.decode(annotation["segmentation"]).astype(bool)
    return list(fields.values())


def dice(found, true):
    """Return the Dice coefficient of two masks."""
    return float(2 * np.sum(found & true) / max(np.sum(found) + np.sum(true), 1))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("synthetic", type=Path)
    parser.add_argument("image", type=Path)
    parser.add_argument("mask", type=Path)
    parser.add_argument("--fields", type=int, default=20)
    arguments = parser.parse_args()
    random = np.random.default_rng(SEED)
    fields = synthetic(arguments.synthetic)
    seen = min(arguments.fields, len(fields) - 2)
    rows, sides = [], []
    for grey, nuclei in fields[:seen]:
        table, mask = features(grey), nuclei.ravel()
        for side in (True, False):
            places = np.flatnonzero(mask == side)
            chosen = random.choice(places, min(PIXELS // 2, places.size), replace=False)
            rows.append(table[chosen])
            sides.append(np.full(chosen.size, side))
    forest = RandomForestClassifier(100, min_samples_leaf=5, n_jobs=-1, random_state=SEED)
    forest.fit(np.concatenate(rows), np.concatenate(sides))

    def probability(grey):
        return forest.predict_proba(features(grey))[:, 1].reshape(grey.shape)

    thresholds = np.linspace(0.3, 0.98, 35)
    scores = np.zeros(thresholds.size)
    for grey, nuclei in fields[seen:]:
        likely = probability(grey)
        scores += [dice(likely >= threshold, nuclei) for threshold in thresholds]
    scores /= len(fields) - seen
    threshold = thresholds[np.argmax(scores)]
    grey = np.asarray(Image.open(arguments.image).convert("L"), dtype=np.float32)
    true = np.asarray(Image.open(arguments.mask).convert("L")) > 0
    real = dice(probability(grey) >= threshold, true)
    found = {
        "fields": seen,
        "threshold": round(float(threshold), 3),
        "dice_synthetic": round(float(scores.max()), 3),
        "dice_real": round(real, 3),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
