"""Trains a small U-Net to find nuclei, and tests it on real fields.

    nucleus_net.py --train SET [SET ...] --test FOLDER --out RESULT.json [--mask IMAGE MASK] [--steps N] [--seed N]
                   [--weights FILE]
    nucleus_net.py --mean WEIGHTS [WEIGHTS ...] --test FOLDER --out RESULT.json [--mask IMAGE MASK]

A SET is a data set of `papsynth generate`, or a folder of data sets, of which the masks of nuclei are learned, or a
folder of PNG and CSV files with the centres of nuclei (y, x), of which discs are learned. SET:N uses N fields, evenly
spread over its files. Each batch has equally many crops of all SETs; the last 60 % of the steps use the last SET alone,
so that a network that learns from synthetic and real fields ends with real ones. In data sets, a part of the crops show
objects that look like nuclei, and their pixels count as much as those of nuclei.

--mean tests the mean probability of networks that were trained before.

Leukocytes that touch a cell do not count: many cannot be told from nuclei, and a network that learns them as
background misses nuclei near the rims of cells.

The test FOLDER holds real fields with centres and frames.csv with their grades. A nucleus is found if a detection lies
within 12 pixels (4 µm). Regions are split at their necks. Detections at the border of the image count only if they
find a nucleus. Writes the numbers of found, detected and annotated nuclei of every field, and the Dice coefficient of
a mask at several scales, as JSON.
"""

import argparse
import csv
import itertools
import json
import os
from pathlib import Path

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")

import numpy as np
import tensorflow as tf
from PIL import Image
from scipy import ndimage
from scipy.optimize import linear_sum_assignment
from skimage.morphology import local_maxima, reconstruction
from skimage.segmentation import watershed

SIDE, BATCH = 192, 8  # side of a crop, pixels; crops of a batch
DISC = 10  # radius of the discs at annotated centres, pixels
REACH = 12  # largest distance of a detection from a nucleus, pixels
THRESHOLD = 0.7  # probability of detections, chosen on the half of the fields that a recipe is matched to
MASK_THRESHOLD = 0.5  # probability of masks
SMALLEST = 60  # area of a detection, pixels
BORDER = 2  # width of the border of the image, pixels: a region can end one pixel before it, at half of the resolution
NECK = 0.5  # least depth of a neck at which a region is split, pixels; chosen on the same half
EMPTY = 0.96  # least light of the empty slide, relative to its mean there: cytoplasm and specks are darker
FITS = 5  # number of fits of the light of the empty slide
MIN_EMPTY = 10  # pixels of the empty slide in a ninth of the image, at an eighth of the resolution
MIN_PARTS = 7  # ninths of the image that have so many, so that the light of the empty slide is fitted
DIMMEST, BRIGHTEST = 0.8, 1.05  # limits of that light, relative to the bright parts of the image
SCALES = (1.0, 1.2)  # of the image with a mask, whose pixel size is not known
CHANNELS = 12  # of the first level of the network
CONTRAST = 4.0  # factor on the images
LAST = 0.6  # part of the steps in which only the last set is used
CYTOPLASM, SHRED, LEUKOCYTE = (1, 2), 4, 5  # semantic classes; shreds and leukocytes look like nuclei
MIMIC_CROPS = 0.35  # share of the crops that are chosen to show such objects
NUCLEUS_WEIGHT = 3.0  # of pixels of nuclei, and of objects that look like them
GAMMA = 1.4  # largest exponent on the darkness of crops; the smallest is 1 / GAMMA
FIXED = 0.3  # darkness that this exponent does not change
UNEVEN = 0.03  # standard deviation of the unevenness of light
NOISE = 0.03  # largest standard deviation of the noise
AT_CELL = 0.1  # least share of the surroundings of a leukocyte at a cell that are cytoplasm
SURROUNDINGS = 3  # width of the surroundings, pixels


def normalized(image):
    """Return the light relative to the empty slide, minus 1: an array of the size of the image, -1 (dark) to 0.3."""
    grey = np.asarray(image.convert("L") if image.mode in ("RGB", "RGBA", "P") else image, dtype=np.float32)
    return np.clip(grey / empty_slide(grey), 0, 1.3) - 1


def empty_slide(grey):
    """Return the light of the empty slide at each pixel: a quadratic surface through the bright parts of the image.

    Where light is uneven, the dim parts of the empty slide would otherwise look like pale cytoplasm. If the empty slide
    is visible in small parts of the image only, one number is used for all pixels.
    """
    small = ndimage.zoom(grey, 0.125, order=1)
    brightest = max(np.quantile(small, 0.97), 1)
    y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in small.shape), indexing="ij")
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    empty = small > EMPTY * brightest
    for _ in range(FITS):
        # Pixels of the empty slide in each ninth of the image.
        parts = [part for rows in np.array_split(empty, 3) for part in np.array_split(rows, 3, axis=1)]
        if sum(part.sum() >= MIN_EMPTY for part in parts) < MIN_PARTS:
            return np.full(grey.shape, brightest, np.float32)
        surface = terms @ np.linalg.lstsq(terms[empty], small[empty], rcond=None)[0]
        empty = small > EMPTY * np.clip(surface, DIMMEST * brightest, None)
    size = [full / part for full, part in zip(grey.shape, small.shape)]
    surface = np.clip(surface, DIMMEST * brightest, BRIGHTEST * brightest)
    return ndimage.zoom(surface, size, order=1).astype(np.float32)


def centres(file):
    """Return the annotated centres (y, x) of a field."""
    rows = [row for row in csv.reader(file.open()) if row and row[0][:1].isdigit()]
    return np.array([[float(value) for value in row[:2]] for row in rows]).reshape(-1, 2)


def discs(shape, places):
    """Return a mask with a disc at every place."""
    mask = np.zeros(shape, np.float32)
    y, x = np.mgrid[: shape[0], : shape[1]]
    for at in places:
        top, left = (max(int(v) - DISC, 0) for v in at)
        part = np.s_[top : int(at[0]) + DISC + 1, left : int(at[1]) + DISC + 1]
        mask[part] = np.maximum(mask[part], np.hypot(y[part] - at[0], x[part] - at[1]) <= DISC)
    return mask


def chosen(files, count):
    """Return `count` evenly spread files, or all if it is None. Files of one grade follow each other."""
    count = len(files) if count is None else min(count, len(files))
    return [files[int((number + 0.5) * len(files) / count)] for number in range(count)]


def at_cells(classes):
    """Return the mask of the leukocytes that lie on a cell or touch one."""
    found = np.zeros(classes.shape, bool)
    regions, _ = ndimage.label(classes == LEUKOCYTE)
    for index, box in enumerate(ndimage.find_objects(regions), 1):
        box = tuple(slice(max(side.start - SURROUNDINGS, 0), side.stop + SURROUNDINGS) for side in box)
        own = regions[box] == index
        around = ndimage.binary_dilation(own, iterations=SURROUNDINGS) & (classes[box] != LEUKOCYTE)
        if np.isin(classes[box][around], CYTOPLASM).sum() > AT_CELL * around.sum():
            found[box] |= own
    return found


def load(name):
    """Return the fields of a set.

    A field has an image and three masks: nuclei, separated where they touch; what looks like nuclei; pixels that do not
    count.
    """
    path, _, count = name.partition(":")
    folder, count = Path(path), int(count) if count else None
    sets = [folder] if (folder / "images").is_dir() else sorted(file.parent for file in folder.glob("*/images"))
    if not sets:
        files = chosen(sorted(folder.glob("*.png")), count)
        images = [normalized(Image.open(file)) for file in files]
        masks = [discs(image.shape, centres(file.with_suffix(".csv"))) for image, file in zip(images, files)]
        return [(image, mask, np.zeros_like(mask), np.zeros_like(mask)) for image, mask in zip(images, masks)]
    fields = []
    for file in chosen(sorted(file for one in sets for file in (one / "images").glob("*.png")), count):
        labels, classes = (
            np.asarray(Image.open(next((file.parent.parent / "labels" / part).glob(f"{file.stem}.*"))))
            for part in ("nucleus", "semantic")
        )
        contact = np.zeros(labels.shape, bool)
        for axis in (0, 1):
            pair = [np.take(labels, range(s, labels.shape[axis] - 1 + s), axis) for s in (0, 1)]
            touching = (pair[0] != pair[1]) & (pair[0] > 0) & (pair[1] > 0)
            contact |= np.pad(touching, [(1, 0) if a == axis else (0, 0) for a in (0, 1)])
        ignored = at_cells(classes)
        masks = (labels > 0) & ~contact, np.isin(classes, (SHRED, LEUKOCYTE)) & ~ignored, ignored & (labels == 0)
        fields.append((normalized(Image.open(file)), *(mask.astype(np.float32) for mask in masks)))
    return fields


def network():
    """Return the U-Net: five levels from half of the resolution, 12 to 192 channels, one output per pixel."""
    layers = tf.keras.layers

    def convolve(x, channels, size, stride=1):
        x = layers.Conv2D(channels, size, strides=stride, padding="same", use_bias=False)(x)
        return layers.ReLU()(layers.BatchNormalization()(x))

    def block(x, channels):
        return convolve(convolve(x, channels, 3), channels, 3)

    start = layers.Input((None, None, 1))
    x = convolve(start, CHANNELS, 4, stride=2)
    skipped = []
    for level in range(4):
        x = block(x, CHANNELS * 2**level)
        skipped.append(x)
        x = layers.MaxPool2D()(x)
    x = block(x, CHANNELS * 16)
    for level in reversed(range(4)):
        x = layers.Conv2D(CHANNELS * 2**level, 3, padding="same")(layers.UpSampling2D()(x))
        x = block(layers.Concatenate()([x, skipped[level]]), CHANNELS * 2**level)
    x = layers.Conv2D(4, 1, dtype="float32")(x)
    return tf.keras.Model(start, layers.Lambda(lambda x: tf.nn.depth_to_space(x, 2), dtype="float32")(x))


def crop(fields, rng):
    """Return a random crop: turned, mirrored, with other contrast, light, blur and noise.

    Most crops have a nucleus or an object that looks like one.
    """
    field = fields[rng.integers(len(fields))]
    shown = field[2 if rng.random() < MIMIC_CROPS else 1]
    for _ in range(12):
        top, left = (rng.integers(0, size - SIDE + 1) for size in shown.shape)
        part = np.s_[top : top + SIDE, left : left + SIDE]
        if shown[part].sum() > 150 or rng.random() < 0.2:
            break
    turns, mirrored = rng.integers(4), rng.random() < 0.5
    turned = (np.rot90(values[part][::-1] if mirrored else values[part], turns) for values in field)
    grey, nuclei, mimics, ignored = turned
    darkness = np.clip(-grey, 0, 1)
    exponent = GAMMA ** rng.uniform(-1, 1)
    grey = np.maximum(grey, 0) - darkness**exponent * FIXED ** (1 - exponent)
    grey = grey * rng.uniform(0.8, 1.25) + rng.uniform(-0.03, 0.03)
    grey = (1 + grey) * (1 + UNEVEN * ndimage.zoom(rng.normal(size=(4, 4)), SIDE / 4, order=1)) - 1
    if rng.random() < 0.5:
        grey = ndimage.gaussian_filter(grey, rng.uniform(0.3, 1.2))
    weight = np.where((nuclei > 0) | (mimics > 0), NUCLEUS_WEIGHT, 1) * (1 - ignored)
    return grey + rng.normal(0, rng.uniform(0, NOISE), grey.shape), nuclei, weight


def train(sets, steps, seed):
    """Return the trained network. Each set gives an equal part of a batch; the last batches are of the last set."""
    rng = np.random.default_rng(seed)
    tf.keras.utils.set_random_seed(seed)
    net = network()
    optimizer = tf.keras.optimizers.Adam(tf.keras.optimizers.schedules.CosineDecay(2e-3, steps))

    @tf.function
    def step(images, targets, weights):
        with tf.GradientTape() as tape:
            logits = net(images, training=True)
            found = tf.sigmoid(logits) * tf.minimum(weights, 1)
            entropy = tf.reduce_mean(weights * tf.nn.sigmoid_cross_entropy_with_logits(targets, logits))
            overlap = (2 * tf.reduce_sum(found * targets) + 1) / (tf.reduce_sum(found) + tf.reduce_sum(targets) + 1)
            loss = entropy + 1 - overlap
        optimizer.apply_gradients(zip(tape.gradient(loss, net.trainable_variables), net.trainable_variables))
        return loss

    losses = []
    for number in range(steps):
        used = sets if number < steps * (1 - LAST) else sets[-1:]
        crops = [crop(used[k % len(used)], rng) for k in range(BATCH)]
        images, targets, weights = (np.array(values, np.float32)[..., None] for values in zip(*crops))
        losses.append(float(step(images * CONTRAST, targets, weights)))
        if number % 100 == 99:
            print(f"step {number + 1} of {steps}, loss {np.mean(losses[-100:]):.3f}", flush=True)
    return net


def probability(nets, image):
    """Return the probability of nucleus of every pixel, 0 to 1.

    It is the mean over the networks, and over the image turned and mirrored in all ways.
    """
    total = np.zeros(image.shape, np.float32)
    views = list(itertools.product(range(4), (1, -1)))
    for net, (turns, step) in itertools.product(nets, views):
        view = np.rot90(image[::step], turns)
        margin = [(0, -size % 32) for size in view.shape]
        padded = np.pad(view, margin, mode="reflect")[None, ..., None].astype(np.float32) * CONTRAST
        found = tf.sigmoid(net(padded, training=False)).numpy()[0, : view.shape[0], : view.shape[1], 0]
        total += np.rot90(found, -turns)[::step]
    return total / (len(nets) * len(views))


def at_border(regions):
    """Return the numbers of the regions at the border of the image."""
    inside = np.zeros(regions.shape, bool)
    inside[BORDER:-BORDER, BORDER:-BORDER] = True
    border = np.unique(regions[~inside])
    return border[border > 0]


def away_from_border(mask):
    """Return a mask without its regions at the border of the image."""
    regions, _ = ndimage.label(mask)
    return mask & ~np.isin(regions, at_border(regions))


def detections(probabilities):
    """Return the centres (y, x) of the nuclei above the threshold, and which of them are at the border of the image.

    Regions are split at their necks: overlapping nuclei have one region.
    """
    mask = ndimage.binary_opening(probabilities > THRESHOLD, iterations=2)
    depth = ndimage.gaussian_filter(ndimage.distance_transform_edt(mask), 1)
    # Rounded, so that peaks of the same height are one if no neck lies between them.
    tops = local_maxima(np.round(reconstruction(depth - NECK, depth), 6)) & mask
    peaks, count = ndimage.label(tops, np.ones((3, 3)))
    if count == 0:
        return np.zeros((0, 2)), np.zeros(0, bool)
    regions, index = watershed(-depth, peaks, mask=mask), np.arange(1, count + 1)
    large = ndimage.sum_labels(mask, regions, index) >= SMALLEST
    places = np.array(ndimage.center_of_mass(mask, regions, index))
    return places[large], np.isin(index, at_border(regions))[large]


def matched(found, true):
    """Return which detections have a nucleus of their own within reach."""
    result = np.zeros(len(found), bool)
    if len(found) and len(true):
        distance = np.hypot(found[:, None, 0] - true[None, :, 0], found[:, None, 1] - true[None, :, 1])
        rows, columns = linear_sum_assignment(np.where(distance <= REACH, distance, 1e4))
        result[rows] = distance[rows, columns] <= REACH
    return result


def counts(probabilities, true):
    """Return the numbers of found nuclei, of detections and of annotated nuclei of a field."""
    places, border = detections(probabilities)
    right = matched(places, true)
    return {"matched": int(right.sum()), "detected": int((right | ~border).sum()), "nuclei": len(true)}


def dice(nets, image, mask):
    """Return the Dice coefficient of a mask, at each scale of the image. Nuclei at the border are left out."""
    scores = []
    for scale in SCALES:
        probabilities = ndimage.zoom(probability(nets, ndimage.zoom(image, scale, order=1)), 1 / scale, order=1)
        height, width = (min(sizes) for sizes in zip(probabilities.shape, mask.shape))
        found = away_from_border(probabilities[:height, :width] > MASK_THRESHOLD)
        true = away_from_border(mask[:height, :width] > 0)
        scores.append(float(2 * (found & true).sum() / max(found.sum() + true.sum(), 1)))
    return scores


def use_bfloat16():
    """Compute with bfloat16 on processors with instructions for it, which takes a third less time."""
    processor = Path("/proc/cpuinfo")
    if processor.exists() and {"avx512_bf16", "amx_bf16"} & set(processor.read_text().split()):
        tf.keras.mixed_precision.set_global_policy("mixed_bfloat16")


def networks(options, parser):
    """Return the network that is trained on the sets, or the networks of which weights are given."""
    if options.mean:
        nets = [network() for _ in options.mean]
        for net, file in zip(nets, options.mean):
            if not Path(file).is_file():
                parser.error(f"{file}: no such file; expected weights that --weights has written")
            net.load_weights(file)
        return nets
    sets = [load(name) for name in options.train]
    if not all(sets) or any(min(image.shape) < SIDE for fields in sets for image, *_ in fields):
        parser.error(f"each training set needs at least one field, of at least {SIDE} pixels")
    return [train(sets, options.steps, options.seed)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--train", nargs="+", metavar="SET")
    source.add_argument("--mean", nargs="+", metavar="WEIGHTS")
    parser.add_argument("--test", type=Path, required=True)
    parser.add_argument("--mask", nargs=2, type=Path)
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--weights", help="file to which the weights are written, .weights.h5")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    use_bfloat16()
    nets = networks(options, parser)
    result = {"train": options.train, "mean": options.mean, "steps": options.steps, "seed": options.seed, "fields": []}
    for row in csv.DictReader((options.test / "frames.csv").open()):
        file = options.test / f"{row['frame']}.png"
        found = counts(probability(nets, normalized(Image.open(file))), centres(file.with_suffix(".csv")))
        result["fields"].append({"frame": row["frame"], "grade": row["grade"].strip(), **found})
    if options.mask:
        image, mask = (Image.open(file) for file in options.mask)
        mask = np.asarray(mask)
        result["dice"] = dice(nets, normalized(image), mask if mask.ndim == 2 else mask[..., 0])
        result["scales"] = SCALES
    if options.weights and options.train:
        nets[0].save_weights(options.weights)
    partial = options.out.with_suffix(".partial")
    partial.write_text(json.dumps(result, indent=1))
    partial.replace(options.out)


if __name__ == "__main__":
    main()
