"""Trains StarDist to find nuclei, from random weights or from the weights of a file.

Needs stardist and tensorflow. Nothing is downloaded. The network is saved in the folder OUT/nuclei.
"""

import math

import numpy as np
import papsynth
from options import options
from stardist.matching import matching_dataset
from stardist.models import Config2D, StarDist2D

RECIPE = papsynth.recipe("lbc", widen=1.5)
FIELDS, VALIDATION = 500, 16  # at most, and in addition


def sample(frame):
    """Return the image, 0 to 1, and the labels of nuclei. StarDist ignores negative labels."""
    labels = frame.labels["nucleus"].copy()
    labels[np.isin(labels, frame.table["id"][frame.ignored()])] = -1
    return frame.image.astype(np.float32) / (2**frame.bits - 1), labels


def turned(image, labels):
    """Return a field turned by a random multiple of 90° and mirrored at random."""
    turns, mirror = np.random.randint(4), np.random.choice([1, -1])
    return np.rot90(image, turns)[::mirror], np.rot90(labels, turns)[::mirror]


def main(arguments=None):
    given = options(__doc__, arguments, steps=20_000, batch=4, weights=True)
    count = min(max(given.steps * given.batch // 100, 8), FIELDS)
    recipe = {**RECIPE, "field": {"width_px": given.size, "height_px": given.size, "pixel_um": 0.5}}
    images, labels = zip(*papsynth.Dataset(recipe, seed=1, length=count, transform=sample))
    others = tuple(zip(*papsynth.Dataset(recipe, seed=2, length=VALIDATION, transform=sample)))
    config = Config2D(
        n_rays=32,
        grid=(2, 2),
        train_patch_size=(given.size, given.size),
        train_batch_size=given.batch,
        train_foreground_only=0,
        train_tensorboard=False,
    )
    model = StarDist2D(config, name="nuclei", basedir=given.out)
    if given.weights:
        model.keras_model.load_weights(given.weights)
    length = min(max(given.steps // 10, 1), 100)
    history = model.train(
        images,
        labels,
        validation_data=others,
        augmenter=turned,
        seed=0,
        epochs=math.ceil(given.steps / length),
        steps_per_epoch=length,
    )
    found = [model.predict_instances(image)[0] for image in others[0]]
    score = matching_dataset([np.maximum(label, 0) for label in others[1]], found, thresh=0.5, show_progress=False)
    print(f"other fields: {score.tp} nuclei found, {score.fp} wrong, {score.fn} missed")
    return history.history["loss"]


if __name__ == "__main__":
    main()
