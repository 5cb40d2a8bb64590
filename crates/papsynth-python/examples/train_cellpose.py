"""Trains Cellpose to find nuclei, from random weights or from the weights of a file.

Needs cellpose 3. Nothing is downloaded. The network is saved as OUT/models/nuclei.
"""

import logging
import math
import tempfile
from pathlib import Path

import numpy as np
import papsynth
from cellpose.metrics import average_precision
from cellpose.models import CellposeModel
from cellpose.train import train_seg
from options import options

RECIPE = papsynth.recipe("lbc", widen=1.5)
FIELDS = 500  # at most
DIAMETER_PX = 17


def sample(frame):
    """Return the image and the labels of nuclei. Nuclei that cannot be seen are background."""
    labels = frame.labels["nucleus"].copy()
    labels[np.isin(labels, frame.table["id"][frame.ignored()])] = 0
    return frame.image, labels


def main(arguments=None):
    given = options(__doc__, arguments, steps=6000, batch=8, weights=True)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    # Every field is used about 100 times, rotated and scaled by Cellpose.
    count = min(max(given.steps * given.batch // 100, 8), FIELDS)
    recipe = {**RECIPE, "field": {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}}
    samples = papsynth.Dataset(recipe, seed=1, length=count, transform=sample)
    # Cellpose cannot use fields without nuclei.
    samples = [(image, label) for image, label in samples if label.any()]
    if not samples:
        raise SystemExit(f"no nucleus in {count} fields of {given.size} pixels; increase --size")
    images, labels = zip(*samples)
    model = CellposeModel(gpu=True, pretrained_model=given.weights or False, diam_mean=DIAMETER_PX)
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(given.out or scratch)
        out.mkdir(parents=True, exist_ok=True)
        _, losses, _ = train_seg(
            model.net,
            images,
            labels,
            channels=[0, 0],
            batch_size=given.batch,
            n_epochs=math.ceil(given.steps * given.batch / len(images)),
            min_train_masks=1,
            save_path=out,
            model_name="nuclei",
        )
    images, labels = zip(*papsynth.Dataset(recipe, seed=2, length=8, transform=sample))
    found, _, _ = model.eval(list(images), channels=[0, 0], diameter=DIAMETER_PX)
    _, hits, wrong, missed = average_precision(list(labels), found, threshold=[0.5])
    print(f"other fields: {hits.sum():.0f} nuclei found, {wrong.sum():.0f} wrong, {missed.sum():.0f} missed")
    return list(losses)


if __name__ == "__main__":
    main()
