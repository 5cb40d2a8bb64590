"""Trains two small U-Nets to outline overlapping cells, and tests them on other synthetic fields.

    overlap_net.py --train SET [SET ...] --test SET [SET ...] --out RESULT.json
                   [--steps N] [--seed N] [--weights PREFIX]

A SET is a data set of `papsynth generate` in the format `folder`; SET:N uses its first N fields. The first network, the
finder, sees a field and returns a heat map of the centres of nuclei. The second one, the outliner, sees the
surroundings of one nucleus and returns the complete (amodal) mask of its cytoplasm, also where other cells cover it.
Masks may therefore overlap. Equal parts of each batch come from each SET.

Score, as in the challenge of ISBI 2014: a cell is found if a mask has a Dice coefficient of more than 0.7 with its
complete cytoplasm; each mask counts for one cell. The score is the mean Dice coefficient of the cells that are found,
and the share of cells that are missed. Masks end at the border of the image. All cells count whose nucleus lies
completely inside the image, however many other cells cover them. Masks that match no cell with a nucleus in the image
are counted as false. Writes the counts of every field as JSON.
"""

import argparse
import json
import os
from pathlib import Path

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")

import numpy as np
import tensorflow as tf
from PIL import Image
from scipy import ndimage, sparse
from scipy.optimize import linear_sum_assignment

from nucleus_net import normalized, use_bfloat16

FINE_UM = 0.5  # pixel size of the light that the networks see; masks and heat maps have pixels of 1 µm
MATCH = 0.7  # smallest Dice coefficient of a cell that is found
# Sides are in µm; light is folded into channels of the first level.
FINDER = dict(side=128, batch=8, fold=4, channels=(24, 48, 64))
OUTLINER = dict(side=112, batch=16, fold=4, channels=(32, 64, 96, 128))
SPOT_UM = 2.5  # standard deviation of the spots at the centres of nuclei
PEAK = 0.4  # smallest height of a detected centre, relative to that of a spot
APART_UM = 4  # smallest distance of two detected centres
WRONG = 0.15  # share of examples of the outliner at places without a nucleus
WRONG_FIELDS, WRONG_UM = 40, 6  # fields of each set in which such places are searched; smallest distance from a nucleus
SAME = 0.7  # masks with more than this intersection over union are one cell
SMALLEST_UM2 = 60  # area of a mask
OUTSIDE = 0.5  # light outside the image, brighter than any light inside
COVERED = 0.4  # probability of the pixels of a mask, chosen on fields of `lbc`
TURNS = (0, 1, 2, 3)  # quarter turns over which the outliner is averaged, each also mirrored
CONTRAST = 4.0  # factor on the light


def decoded(rle):
    """Return the mask of a run-length encoding of COCO."""
    runs, value, shift = [], 0, 0
    for byte in rle["counts"].encode():
        value |= (byte - 48 & 31) << shift
        shift += 5
        if not byte - 48 & 32:
            value -= (byte - 48 & 16) << shift - 4
            runs.append(value + (runs[-2] if len(runs) > 2 else 0))
            value = shift = 0
    height, width = rle["size"]
    return np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(width, height).T


def resized(values, size, how=Image.Resampling.BOX):
    """Return an array with another size (height, width)."""
    return np.asarray(Image.fromarray(np.asarray(values, np.float32)).resize(size[::-1], how))


def load(name, limit=None):
    """Return the fields of a set.

    A field has light with pixels of FINE_UM, centres of nuclei (µm), and the corner and mask of each cytoplasm (µm).
    """
    path, _, count = name.partition(":")
    fields = []
    for file in sorted((Path(path) / "shards").glob("*.coco.json")):
        shard = json.loads(file.read_text())
        for image in shard["images"]:
            if len(fields) == (int(count) if count else limit):
                return fields
            full = image["height"], image["width"]
            size = tuple(round(side * image["pixel_um"]) for side in full)
            fine_size = [round(side / FINE_UM) for side in size]
            light = resized(normalized(Image.open(Path(path) / image["file_name"])), fine_size)
            objects = [a for a in shard["annotations"] if a["image_id"] == image["id"]]
            nuclei = {a["object_id"]: a for a in objects if a["part"] == "nucleus"}
            cells = [a for a in objects if a["part"] == "cytoplasm" and a["object_id"] in nuclei]
            nuclei = [nuclei[a["object_id"]] for a in cells]
            scale = np.array(size) / full
            centres = np.array([(a["centroid"][::-1] + np.array(0.5)) * scale - 0.5 for a in nuclei]).reshape(-1, 2)
            masks = []
            for cell in cells:
                mask = resized(decoded(cell["segmentation"]), size) > 0.5
                box = ndimage.find_objects(mask.astype(np.int8))
                box = box[0] if box else np.s_[0:1, 0:1]
                masks.append(((box[0].start, box[1].start), mask[box]))
            field = {"light": light.astype(np.float16), "size": size, "centres": centres, "masks": masks, "full": full}
            field |= {"name": image["file_name"], "cells": [cell["segmentation"] for cell in cells]}
            fields.append(field | {"scored": [not a["truncated"] for a in nuclei]})
    return fields


def window(values, corner, side, outside=0.0, fine=1):
    """Return a square part of an array, `outside` beyond its border.

    The corner (y, x) and the side are in units of `fine` pixels.
    """
    part = np.full((side * fine, side * fine), outside, np.float32)
    start = [c * fine for c in corner]
    low = [min(max(s, 0), n) for s, n in zip(start, values.shape)]
    high = [min(max(s + side * fine, 0), n) for s, n in zip(start, values.shape)]
    into = tuple(slice(a - s, b - s) for a, b, s in zip(low, high, start))
    part[into] = values[low[0] : high[0], low[1] : high[1]]
    return part


def placed(mask, corner, side):
    """Return the part of a mask, given with its own corner, in a square."""
    return window(mask[1], [c - m for c, m in zip(corner, mask[0])], side)


def spots(places, corner, side):
    """Return a map with a spot at each place (y, x), of height 1."""
    size = (side, side) if np.isscalar(side) else side
    found = np.zeros(size, np.float32)
    y, x = (np.arange(n, dtype=np.float32) for n in size)
    for at in np.asarray(places).reshape(-1, 2) - corner:
        found = np.maximum(found, np.exp(-((y - at[0])[:, None] ** 2 + (x - at[1])[None, :] ** 2) / (2 * SPOT_UM**2)))
    return found


def folded(values, factor):
    """Return each square of `factor` pixels as channels of one pixel."""
    height, width = (side // factor for side in values.shape)
    return values.reshape(height, factor, width, factor).swapaxes(1, 2).reshape(height, width, factor**2)


def inputs(light, maps, fold):
    """Return the channels of a network: light, and maps with pixels of 1 µm."""
    coarse = [folded(values, max(round(fold * FINE_UM), 1)) for values in maps]
    return np.concatenate([folded(light * CONTRAST, fold), *coarse], -1).astype(np.float32)


def network(kind, maps):
    """Return a U-Net; its output has pixels of 1 µm."""
    layers = tf.keras.layers

    def block(x, channels):
        for _ in range(2):
            x = layers.Conv2D(channels, 3, padding="same", use_bias=False)(x)
            x = layers.ReLU()(layers.BatchNormalization()(x))
        return x

    factor = round(kind["fold"] * FINE_UM)
    start = x = layers.Input((None, None, kind["fold"] ** 2 + maps * factor**2))
    skipped = []
    for channels in kind["channels"][:-1]:
        x = block(x, channels)
        skipped.append(x)
        x = layers.MaxPool2D()(x)
    x = block(x, kind["channels"][-1])
    for channels, skip in zip(reversed(kind["channels"][:-1]), reversed(skipped)):
        x = layers.Conv2D(channels, 3, padding="same")(layers.UpSampling2D()(x))
        x = block(layers.Concatenate()([x, skip]), channels)
    x = layers.Conv2D(factor**2, 1, dtype="float32")(x)
    if factor > 1:
        x = layers.Lambda(lambda y: tf.nn.depth_to_space(y, factor), dtype="float32")(x)
    return tf.keras.Model(start, x)


def altered(light, rng):
    """Return light of another lamp, focus and camera."""
    light = light * rng.uniform(0.75, 1.3) + rng.uniform(-0.03, 0.03)
    if rng.random() < 0.5:
        light = ndimage.gaussian_filter(light, rng.uniform(0.3, 1.5))
    return light + rng.normal(0, rng.uniform(0, 0.03), light.shape)


def turned(arrays, rng):
    """Return the arrays turned and mirrored in the same way."""
    turns, mirrored = rng.integers(4), rng.random() < 0.5
    return [np.rot90(values[::-1] if mirrored else values, turns) for values in arrays]


def square(field, corner, side, rng):
    """Return the light of a square, altered, and where it is inside the image."""
    light = window(field["light"], corner, side, np.nan, fine=round(1 / FINE_UM))
    outside = np.isnan(light)
    light = np.where(outside, OUTSIDE, altered(np.where(outside, 0, light), rng))
    return light, window(np.ones(field["size"], np.float32), corner, side)


def finder_example(fields, rng):
    """Return input, target and weight of a random square of a field."""
    field, side = fields[rng.integers(len(fields))], FINDER["side"]
    corner = [int(rng.integers(-8, n - side + 9)) for n in field["size"]]
    light, weight = square(field, corner, side, rng)
    light, weight, target = turned([light, weight, spots(field["centres"], corner, side)], rng)
    return inputs(light, [], FINDER["fold"]), target, weight


def outliner_example(fields, rng):
    """Return input, target and weight of a random cell, or of a place without a nucleus, whose mask is empty."""
    side = OUTLINER["side"]
    wrong = rng.random() < WRONG and any(len(field["wrong"]) for field in fields)
    places = "wrong" if wrong else "centres"
    fields = [field for field in fields if len(field[places])]
    field = fields[rng.integers(len(fields))]
    index = rng.integers(len(field[places]))
    others = field["centres"] if wrong else np.delete(field["centres"], index, axis=0)
    others = others[rng.random(len(others)) > 0.06]  # the finder misses some nuclei
    at = field[places][index] + rng.normal(0, 1, 2)
    corner = [int(v) - side // 2 for v in np.rint(at)]
    light, weight = square(field, corner, side, rng)
    maps = spots([at], corner, side), spots(others, corner, side)
    target = np.zeros((side, side), np.float32) if wrong else placed(field["masks"][index], corner, side)
    light, weight, target, *maps = turned([light, weight, target, *maps], rng)
    return inputs(light, maps, OUTLINER["fold"]), target, weight


def train(net, kind, example, sets, steps, seed, dice):
    """Train a network on batches of which each set gives an equal part."""
    rng = np.random.default_rng(seed)
    rate = tf.keras.optimizers.schedules.CosineDecay(2e-3, steps, warmup_target=2e-3)
    optimizer = tf.keras.optimizers.AdamW(rate, weight_decay=1e-4)

    @tf.function(autograph=False)
    def step(images, targets, weights):
        with tf.GradientTape() as tape:
            logits = net(images, training=True)
            found = tf.sigmoid(logits) * weights
            loss = tf.nn.sigmoid_cross_entropy_with_logits(targets, logits) * weights
            if dice:
                common, both = (tf.reduce_sum(v, (1, 2, 3)) for v in (found * targets, (found + targets) * weights))
                loss = tf.reduce_mean(loss) + 1 - tf.reduce_mean((2 * common + 1) / (both + 1))
            else:
                loss = 10 * tf.reduce_mean(loss * (1 + 5 * targets))
        optimizer.apply_gradients(zip(tape.gradient(loss, net.trainable_variables), net.trainable_variables))
        return loss

    losses = []
    for number in range(steps):
        batch = [example(sets[k % len(sets)], rng) for k in range(kind["batch"])]
        images, targets, weights = (np.array(values, np.float32) for values in zip(*batch))
        losses.append(float(step(images, targets[..., None], weights[..., None])))
        if number % 50 == 49:
            print(f"step {number + 1} of {steps}, loss {np.mean(losses[-50:]):.4f}", flush=True)


def probability(net, batch):
    """Return the probability of every pixel of a batch."""
    return 1 / (1 + np.exp(-net.predict_on_batch(np.array(batch))[..., 0]))


def heat(finder, field):
    """Return the heat map of a field, the mean over its mirror images."""
    step = round(FINDER["fold"] * FINE_UM) * 2 ** (len(FINDER["channels"]) - 1)
    margin = [(0, -n % step * round(1 / FINE_UM)) for n in field["size"]]
    light = np.pad(field["light"].astype(np.float32), margin, constant_values=OUTSIDE)
    mirrored = (np.s_[:, :], np.s_[::-1, :], np.s_[:, ::-1], np.s_[::-1, ::-1])
    maps = probability(finder, [inputs(light[part], [], FINDER["fold"]) for part in mirrored])
    found = np.mean([values[part] for values, part in zip(maps, mirrored)], 0)
    return found[: field["size"][0], : field["size"][1]]


def peaks(found):
    """Return the places (y, x) of the maxima of a heat map."""
    smooth = ndimage.gaussian_filter(found, 1)
    reach = np.hypot(*np.mgrid[-APART_UM : APART_UM + 1, -APART_UM : APART_UM + 1]) <= APART_UM
    tops = (smooth == ndimage.maximum_filter(smooth, footprint=reach)) & (found > PEAK)
    return np.argwhere(tops).astype(float)


def find_wrong(finder, fields):
    """Store the detections of the finder that are not nuclei with each field, as examples of the outliner."""
    for field in fields:
        field["wrong"] = np.zeros((0, 2))
    for field in fields[:WRONG_FIELDS]:
        places = peaks(heat(finder, field))
        distance = np.hypot(*np.moveaxis(places[:, None] - field["centres"][None], -1, 0))
        field["wrong"] = places[distance.min(1, initial=np.inf) > WRONG_UM]


def outlines(outliner, field, centres):
    """Return the corner and the probability of the cytoplasm at each of the centres.

    The probability is the mean over turned and mirrored images.
    """
    side, fine = OUTLINER["side"], round(1 / FINE_UM)
    found = []
    for own in range(len(centres)):
        corner = [int(v) - side // 2 for v in np.rint(centres[own])]
        light = window(field["light"], corner, side, OUTSIDE, fine)
        maps = [spots([centres[own]], corner, side), spots(np.delete(centres, own, axis=0), corner, side)]
        ways = [(turns, mirror) for turns in TURNS for mirror in (1, -1)]
        batch = [
            inputs(np.rot90(light[::m], t), [np.rot90(v[::m], t) for v in maps], OUTLINER["fold"]) for t, m in ways
        ]
        views = zip(probability(outliner, batch), ways)
        found.append((corner, np.mean([np.rot90(v, -t)[::m] for v, (t, m) in views], 0)))
    return found


def cells(found, field):
    """Return the masks of the cells, with the pixels of the image.

    Of two masks that are nearly the same, returns only the more certain one.
    """
    masks, kept = [], []
    certain = [float(p[p > COVERED].mean()) if (p > COVERED).sum() >= SMALLEST_UM2 else 0.0 for _, p in found]
    for index in np.argsort(certain)[::-1]:
        if certain[index] == 0:
            break
        corner, part = found[index]
        whole = np.zeros(field["size"], np.float32)
        low = [max(c, 0) for c in corner]
        high = [min(c + n, m) for c, n, m in zip(corner, part.shape, field["size"])]
        inside = tuple(slice(a - c, b - c) for a, b, c in zip(low, high, corner))
        whole[low[0] : high[0], low[1] : high[1]] = part[inside]
        mask = whole > COVERED
        if all((mask & other).sum() <= SAME * (mask | other).sum() for other in kept):
            kept.append(mask)
            masks.append(resized(whole, field["full"], Image.Resampling.BILINEAR) > COVERED)
    return masks


def score(masks, field):
    """Return the counts of a field, and the Dice coefficients of the cells that are found."""
    true = [decoded(rle) for rle in field["cells"]]
    scored = np.array(field["scored"], bool)
    counts = {"field": field["name"], "cells": int(scored.sum()), "masks": len(masks)}
    if not masks or not true:
        return counts | {"dice": [], "false": len(masks)}
    pair = [sparse.csr_matrix(np.array(values).reshape(len(values), -1), dtype=np.int32) for values in (true, masks)]
    areas = [np.asarray(values.sum(1)).ravel() for values in pair]
    dice = 2 * (pair[0] @ pair[1].T).toarray() / (areas[0][:, None] + areas[1][None, :])
    rows, columns = linear_sum_assignment(np.where(dice > MATCH, dice, 0), maximize=True)
    matched = dice[rows, columns] > MATCH
    found = [float(value) for value in dice[rows, columns][matched & scored[rows]]]
    return counts | {"dice": found, "false": int(len(masks) - matched.sum())}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--train", nargs="+", required=True)
    parser.add_argument("--test", nargs="+", required=True)
    parser.add_argument("--steps", type=int, default=3600, help="of the outliner")
    parser.add_argument("--finder-steps", type=int, default=800)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--weights", help="prefix of the files to which the weights are written")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    tf.keras.utils.set_random_seed(options.seed)
    use_bfloat16()
    sets = [load(name) for name in options.train]
    if not all(any(len(field["centres"]) for field in fields) for fields in sets):
        parser.error("each training set needs at least one cell with a nucleus")
    finder, outliner = network(FINDER, 0), network(OUTLINER, 2)
    train(finder, FINDER, finder_example, sets, options.finder_steps, options.seed, dice=False)
    for fields in sets:
        find_wrong(finder, fields)
    train(outliner, OUTLINER, outliner_example, sets, options.steps, options.seed, dice=True)
    if options.weights:
        finder.save_weights(f"{options.weights}-finder.weights.h5")
        outliner.save_weights(f"{options.weights}-outliner.weights.h5")
    result = {
        "train": options.train,
        "steps": options.steps,
        "seed": options.seed,
        "tests": {name: [] for name in options.test},
    }
    for name, scores in result["tests"].items():
        for field in load(name):
            masks = cells(outlines(outliner, field, peaks(heat(finder, field))), field)
            scores.append(score(masks, field))
    partial = options.out.with_suffix(".partial")
    partial.write_text(json.dumps(result, indent=1))
    partial.replace(options.out)


if __name__ == "__main__":
    main()
