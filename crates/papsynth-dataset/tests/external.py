"""Checks a data set with independent readers.

Usage: python external.py DIR

Needs numpy, pillow, tifffile, pycocotools; ome-types is optional. Prints a line for each check and exits with
status 1 at the first failure.
"""

import csv
import hashlib
import json
import re
import sys
from pathlib import Path

import numpy as np
import tifffile
from PIL import Image
from pycocotools import mask as rle
from pycocotools.coco import COCO

try:
    import ome_types
except ImportError:
    ome_types = None

# The last four are nuclei and objects that look like nuclei. Those that cannot be seen are ignored.
SEMANTIC = ["background", "cytoplasm", "folded-cytoplasm", "debris", "shred", "leukocyte", "bare-nucleus", "nucleus"]
MIN_DETECTABILITY = 15
GROUPS = {"cytoplasm": "cytoplasm", "nucleus": "nucleus", "whole": "debris"}


def check(condition, message):
    """Exits unless the condition holds."""
    if not condition:
        print(f"FAILED: {message}")
        sys.exit(1)


def passed(message):
    print(f"ok: {message}")


def equal(what, found, expected):
    check(found == expected, f"{what}: found {found}, expected {expected}")


def read_json(path):
    return json.loads(path.read_text())


def own_sha256(text, key):
    """Returns the SHA-256 of a JSON document without white space, with an empty value of `key`."""
    compact = re.sub(r'("(?:[^"\\]|\\.)*")|\s+', lambda match: match[1] or "", text)
    return hashlib.sha256(re.sub(rf'"{key}":"[0-9a-f]*"}}$', f'"{key}":""}}', compact).encode()).hexdigest()


def check_manifest(folder):
    """Compares all files with the manifest; returns manifest and records."""
    text = (folder / "manifest.json").read_text()
    manifest = json.loads(text)
    equal("manifest format", manifest["format"], "papsynth-dataset")
    head = text.partition(',"files":[')[0] + "}"
    equal("SHA-256 of the manifest's head", own_sha256(head, "head_sha256"), manifest["head_sha256"])
    listed = {entry["path"]: entry for entry in manifest["files"]}
    equal("number of listed files", len(listed), len(manifest["files"]))
    found = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()} - {"manifest.json"}
    equal("files that are not listed", sorted(found - listed.keys()), [])
    equal("listed files that are missing", sorted(listed.keys() - found), [])
    for name, entry in listed.items():
        content = (folder / name).read_bytes()
        equal(f"size of {name}", len(content), entry["bytes"])
        equal(f"SHA-256 of {name}", hashlib.sha256(content).hexdigest(), entry["sha256"])
    for name in ["recipe", "model"]:
        path = {"recipe": "recipe.toml", "model": "model.json"}[name]
        equal(f"identity of {path}", manifest["identity"][f"{name}_sha256"], listed[path]["sha256"])
    records = []
    for path in sorted((folder / "shards").glob("*.json")):
        if path.name.endswith(".coco.json"):
            continue
        record = read_json(path)
        number = record["shard"]
        equal(f"number of {path}", f"{number:06}.json", path.name)
        equal(f"SHA-256 in {path}", own_sha256(path.read_text(), "sha256"), record["sha256"])
        for key in ["identity", "layout"]:
            equal(f"{key} in {path}", record[key], manifest[key])
        own = [entry for entry in listed.values() if entry.get("shard") == number]
        own = [{k: v for k, v in e.items() if k != "shard"} for e in own if e["path"] != f"shards/{path.name}"]
        equal(f"files of shard {number}", own, record["files"])
        records.append(record)
    equal("number of shards", len(records), manifest["shards"])
    equal("number of frames", sum(len(record["frames"]) for record in records), manifest["frames"])
    shared = {name for name, entry in listed.items() if "shard" not in entry}
    for name in ["README.md", "croissant.json", "splits.csv", "contact-sheet.png", "recipe.toml", "model.json"]:
        check(name in shared, f"{name} is not listed as a file of the data set")
    passed(f"manifest: {len(listed)} files with the listed size and SHA-256, no other files")
    return manifest, records


def check_stack(path, frame):
    """OME-TIFF: axes, sizes, pixel size, step, type."""
    planes, height, width = len(frame["planes_um"]), frame["height"], frame["width"]
    with tifffile.TiffFile(path) as file:
        check(file.is_ome, f"{path} is not an OME-TIFF for tifffile")
        equal(f"pages of {path}", len(file.pages), planes)
        series = file.series[0]
        colour = frame["channels"] == 3
        equal(f"axes of {path}", series.axes, "ZYXS" if colour else "ZYX")
        equal(f"shape of {path}", series.shape, (planes, height, width, 3) if colour else (planes, height, width))
        stack = series.asarray()
        description = file.ome_metadata
    equal(f"type of {path}", stack.dtype, np.dtype("u1" if frame["bits"] <= 8 else "u2"))
    pixels = tifffile.xml2dict(description)["OME"]["Image"]["Pixels"]
    step = abs(frame["planes_um"][1] - frame["planes_um"][0])
    for key, value in [
        ("PhysicalSizeX", frame["pixel_um"]),
        ("PhysicalSizeY", frame["pixel_um"]),
        ("PhysicalSizeZ", step),
    ]:
        check(abs(float(pixels[key]) - value) < 1e-9, f"{key} of {path}: found {pixels[key]}, expected {value}")
        equal(f"{key}Unit of {path}", pixels[f"{key}Unit"], "µm")
    if ome_types is not None:
        typed = ome_types.from_xml(description).images[0].pixels
        equal(f"SizeZ of {path} by ome-types", typed.size_z, planes)
        equal(f"SizeC of {path} by ome-types", typed.size_c, frame["channels"])
        found = [plane.position_z for plane in typed.planes]
        check(np.allclose(found, frame["planes_um"]), f"positions of {path}: {found}")
    return stack


def check_preview(folder, frame, picture):
    """Checks the 8-bit preview of an image with more bits."""
    path = folder / "preview" / f"{frame['index']:06}.png"
    equal(f"training_bits of frame {frame['index']}", frame["training_bits"], min(frame["bits"], 8))
    equal(f"existence of {path}", path.exists(), frame["bits"] > 8)
    if not path.exists():
        return
    with Image.open(path) as image:
        preview = np.array(image)
    equal(f"type of {path}", preview.dtype, np.dtype("u1"))
    equal(f"shape of {path}", preview.shape, picture.shape)
    if frame["channels"] == 1:
        scaled = np.rint(picture * (255 / (2 ** frame["bits"] - 1)))
        check(np.array_equal(preview, scaled), f"{path} is not the image at 8 bits")


def check_images(folder, frame):
    """Checks type and shape of all images of a frame; returns its label images."""
    name, shape = f"{frame['index']:06}", (frame["height"], frame["width"])
    pixels = shape if frame["channels"] == 1 else (*shape, 3)
    white = 2 ** frame["bits"] - 1
    planes = len(frame["planes_um"])
    grey = "u1" if frame["bits"] <= 8 else "u2"
    flat = folder / ("images" if planes == 1 else "all-in-focus") / f"{name}.png"
    with Image.open(flat) as image:
        image.load()
        picture = np.array(image)
    equal(f"shape of {flat}", picture.shape, pixels)
    # Pillow truncates 16-bit colour to 8 bits.
    equal(f"type of {flat}", picture.dtype, np.dtype(grey if frame["channels"] == 1 else "u1"))
    check(picture.max() <= white, f"{flat} exceeds {frame['bits']} bits")
    check_preview(folder, frame, picture)
    if planes > 1:
        stack = check_stack(folder / "images" / f"{name}.ome.tif", frame)
    else:
        stack = picture[None]
    floats = tifffile.imread(folder / "noise-free" / f"{name}.tif").reshape(planes, *pixels)
    equal(f"type of noise-free/{name}.tif", floats.dtype, np.dtype("f4"))
    check(np.isfinite(floats).all(), f"noise-free/{name}.tif is not finite")
    # The mean of the noise over a plane is nearly 0, except for saturated pixels.
    clipped = np.clip(floats, 0, white)
    own = tuple(range(1, stack.ndim))
    off = np.abs(stack.astype(float).mean(axis=own) - clipped.mean(axis=own))
    check((off < 0.02 * white + 0.5).all(), f"{name}: planes are {off} grey levels from the noise-free planes")
    labels = {}
    for kind in ["cytoplasm", "nucleus", "debris", "layers"]:
        path = folder / "labels" / kind / f"{name}.tif"
        labels[kind] = tifffile.imread(path)
        equal(f"shape of {path}", labels[kind].shape, shape)
        wide = "u4" if labels[kind].max(initial=0) > 65535 else "u2"
        equal(f"type of {path}", labels[kind].dtype, np.dtype(wide))
    path = folder / "labels" / "semantic" / f"{name}.png"
    labels["semantic"] = np.asarray(Image.open(path))
    equal(f"shape and type of {path}", (labels["semantic"].shape, labels["semantic"].dtype), (shape, np.dtype("u1")))
    return labels


def check_objects(coco, rows, frame, labels):
    """Compares masks, table and label images."""
    index = frame["index"]
    annotations = coco.loadAnns(coco.getAnnIds(imgIds=[index]))
    equal(f"objects of frame {index} in coco.json and objects.csv", len(annotations), len(rows))
    layers = np.zeros(labels["layers"].shape, int)
    drawn = {kind: np.zeros(labels[kind].shape, np.int64) for kind in GROUPS.values()}
    counts = {}
    # The semantic label image, class by class. Ignored objects are between debris and mimics.
    order = [*SEMANTIC[:4], "ignored", *SEMANTIC[4:]]
    rank = np.zeros(labels["semantic"].shape, np.uint8)
    for annotation, row in zip(annotations, rows):
        name = f"object {row['id']} ({row['part']}) of frame {index}"
        equal(f"id of {name}", annotation["object_id"], int(row["id"]))
        equal(f"part of {name}", annotation["part"], row["part"])
        category = coco.cats[annotation["category_id"]]
        counts[category["name"]] = counts.get(category["name"], 0) + 1
        equal(f"group of {name}", category["supercategory"], GROUPS[row["part"]])
        complete, visible = coco.annToMask(annotation), rle.decode(annotation["visible"])
        for what, found in [
            ("pycocotools' area", int(rle.area(annotation["segmentation"]))),
            ("sum of the mask", int(complete.sum())),
            ("area_px", int(row["area_px"])),
        ]:
            equal(f"{what} of {name}", found, annotation["area"])
        equal(f"visible_area_px of {name}", int(row["visible_area_px"]), int(visible.sum()))
        check(not (visible & ~complete).any(), f"visible mask of {name} is not within its complete mask")
        box = [int(row[f"bbox_{side}_px"] or 0) for side in ["x", "y", "width", "height"]]
        equal(f"bbox of {name}", annotation["bbox"], box)
        equal(f"pycocotools' bbox of {name}", [int(v) for v in rle.toBbox(annotation["segmentation"])], box)
        y, x = np.nonzero(complete)
        centroid = [float(row["centroid_x_px"]), float(row["centroid_y_px"])]
        check(np.allclose(centroid, [x.mean(), y.mean()], atol=1e-6), f"centroid of {name}: {centroid}")
        for column in ["defocus_um", "detectability"]:
            equal(f"values of {column} of {name}", len(row[column].split(";")), len(frame["planes_um"]))
        values = [float(v) for v in row["detectability"].split(";")]
        equal(f"best_plane of {name}", int(row["best_plane"]), int(np.argmax(values)))
        equal(f"semantic class of {name}", annotation["semantic_class"], row["semantic_class"])
        due = row["semantic_class"] in SEMANTIC[4:] and float(row["best_detectability"]) < MIN_DETECTABILITY
        equal(f"iscrowd of {name}", annotation["iscrowd"], int(due))
        level = order.index("ignored" if due else row["semantic_class"])
        rank = np.maximum(rank, level * complete)
        group = GROUPS[row["part"]]
        check(not drawn[group][visible > 0].any(), f"visible mask of {name} overlaps another of its group")
        drawn[group][visible > 0] = annotation["object_id"]
        if row["part"] == "cytoplasm":
            layers += complete
    for kind, picture in drawn.items():
        check(np.array_equal(picture, labels[kind]), f"visible masks of frame {index} differ from labels/{kind}")
    check(np.array_equal(layers, labels["layers"]), f"masks of frame {index} differ from labels/layers")
    value = np.array([255 if one == "ignored" else SEMANTIC.index(one) for one in order])
    check(np.array_equal(value[rank], labels["semantic"]), f"masks of frame {index} differ from labels/semantic")
    equal(f"counts of frame {index}", counts, frame["objects"])


def main(folder):
    manifest, records = check_manifest(folder)
    coco = COCO(folder / "coco.json")
    check(all(i > 0 for i in coco.anns), "annotation ids begin at 1")
    equal("categories of coco.json", list(coco.cats.values()), manifest["categories"])
    passed(f"coco.json: pycocotools reads {len(coco.imgs)} images and {len(coco.anns)} annotations")
    with open(folder / "objects.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    equal("rows of objects.csv", len(rows), len(coco.anns))
    equal("number of images", len(coco.imgs), manifest["frames"])
    for frame in (frame for record in records for frame in record["frames"]):
        image = coco.imgs[frame["index"]]
        saturated = [int(rle.area(mask)) for mask in image.get("saturated", [])]
        equal(
            f"saturated pixels of frame {frame['index']}",
            saturated or [0] * len(frame["planes_um"]),
            frame["saturated_px"],
        )
        check((folder / image["file_name"]).exists(), f"{image['file_name']} is missing")
        equal(f"size of frame {frame['index']}", [image["width"], image["height"]], [frame["width"], frame["height"]])
        labels = check_images(folder, frame)
        own = [row for row in rows if int(row["image"]) == frame["index"]]
        check_objects(coco, own, frame, labels)
        kind = "image" if len(frame["planes_um"]) == 1 else f"stack of {len(frame['planes_um'])} planes"
        passed(f"frame {frame['index']}: {kind}, labels, and {len(own)} masks agree")
    with Image.open(folder / "contact-sheet.png") as sheet:
        sheet.load()
        equal("mode of the contact sheet", sheet.mode, "RGB")
    passed("contact-sheet.png opens")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
