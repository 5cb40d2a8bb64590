"""Checks every format of a data set with independent readers: against each other, and against the masks in
shards/*.coco.json.

Usage: python external_formats.py DIR [PAGES]

DIR is a data set with all formats. PAGES is the folder docs/formats; the Python code of its pages is run. Needs numpy,
pillow, tifffile, imagecodecs, ome-types, lxml, pycocotools, webdataset, shapely. Prints a line for each check and exits
with status 1 at the first failure.
"""

import contextlib
import csv
import hashlib
import io
import json
import re
import sys
import uuid
import warnings
from collections import Counter
from pathlib import Path

import imagecodecs
import numpy as np
import ome_types
import shapely
import tifffile
import webdataset
from PIL import Image
from pycocotools import mask as rle
from pycocotools.coco import COCO
from shapely.geometry import shape

from external import GROUPS, check, check_manifest, equal, passed, read_json

# Groups of the formats for segmenters.
FLAT = ["cytoplasm", "nucleus"]


def same(what, found, expected):
    """Exits unless two arrays have equal shape and values."""
    equal(f"shape of {what}", found.shape, expected.shape)
    check(np.array_equal(found, expected), f"{what}: {np.count_nonzero(found != expected)} values differ")


class Object:
    """An annotation with its masks."""

    def __init__(self, annotation):
        self.annotation = annotation
        self.group = GROUPS[annotation["part"]]
        self.id = annotation["object_id"]
        self.mask = rle.decode(annotation["segmentation"]).astype(bool)
        self.visible = rle.decode(annotation["visible"]).astype(bool)
        self.name = f"object {self.id} ({annotation['part']}) of frame {annotation['image_id']}"


class Frame:
    """A frame: its record and ground truth."""

    def __init__(self, folder, record, summary, coco):
        self.folder, self.shard, self.summary, self.coco = folder, record["shard"], summary, coco
        self.index, self.name = summary["index"], f"{summary['index']:06}"
        self.shape = summary["height"], summary["width"]
        self.planes, self.colour = len(summary["planes_um"]), summary["channels"] == 3
        self.objects = [Object(a) for a in coco.loadAnns(coco.getAnnIds(imgIds=[self.index]))]
        self.policy = record["layout"]["flatten"]

    def of(self, group):
        return [one for one in self.objects if one.group == group]

    def labels(self, group, policy):
        """Returns the labels of a group, one per pixel."""
        labels = np.zeros(self.shape, np.int64)
        if policy == "top":
            for one in self.of(group):
                labels[one.visible] = one.id
            return labels
        covered = np.zeros(self.shape, int)
        for one in sorted(self.of(group), key=lambda one: one.id):
            labels[one.mask] = one.id
            covered += one.mask
        if policy == "drop":
            labels[covered > 1] = 0
        return labels

    def picture(self):
        """Returns the image; of a stack, the all-in-focus image."""
        path = self.folder / ("images" if self.planes == 1 else "all-in-focus") / f"{self.name}.png"
        # Pillow truncates 16-bit colour to 8 bits.
        return imagecodecs.png_decode(path.read_bytes())

    def stack(self):
        """Returns all planes."""
        if self.planes == 1:
            return self.picture()[None]
        return tifffile.imread(self.folder / "images" / f"{self.name}.ome.tif")

    def at_8_bits(self, levels):
        """Returns the levels as formats for training have them."""
        bits = self.summary["bits"]
        return np.rint(levels * (255 / (2**bits - 1))).astype(np.uint8) if bits > 8 else levels


def check_truth(folder, records):
    """Reads COCO of the shards with pycocotools; returns all frames."""
    frames, objects = [], 0
    for record in records:
        # pycocotools prints its time.
        with contextlib.redirect_stdout(None):
            coco = COCO(folder / f"shards/{record['shard']:06}.coco.json")
        equal(f"images of shard {record['shard']}", sorted(coco.imgs), [f["index"] for f in record["frames"]])
        check(all(i > 0 for i in coco.anns), "annotation ids begin at 1")
        frames += [Frame(folder, record, summary, coco) for summary in record["frames"]]
    for frame in frames:
        for one in frame.objects:
            annotation = one.annotation
            objects += 1
            for key in ["segmentation", "visible"]:
                equal(f"size of {key} of {one.name}", tuple(annotation[key]["size"]), frame.shape)
                again = rle.encode(np.asfortranarray(rle.decode(annotation[key])))
                written = annotation[key]["counts"]
                written = written if isinstance(written, bytes) else written.encode()
                equal(f"counts of {key} of {one.name} after decoding and encoding", again["counts"], written)
            equal(f"area of {one.name}", annotation["area"], int(rle.area(annotation["segmentation"])))
            equal(f"visible_area of {one.name}", annotation["visible_area"], int(rle.area(annotation["visible"])))
            box = [float(v) for v in annotation["bbox"]]
            equal(f"bbox of {one.name}", [float(v) for v in rle.toBbox(annotation["segmentation"])], box)
            if annotation["area"]:
                y, x = np.nonzero(one.mask)
                check(np.allclose(annotation["centroid"], [x.mean(), y.mean()], atol=1e-6), f"centroid of {one.name}")
            check(not (one.visible & ~one.mask).any(), f"visible mask of {one.name} is not within its complete mask")
            parent = annotation["parent_id"]
            if parent is not None:
                cell = frame.coco.anns[parent]
                equal(f"parent of {one.name}", [cell["object_id"], cell["part"]], [one.id, "cytoplasm"])
        for group in GROUPS.values():
            # The object nearest to the objective is visible; at equal depths, that with the larger id.
            order = sorted(frame.of(group), key=lambda one: (one.annotation["depth_um"], one.id))
            nearest = np.zeros(frame.shape, np.int64)
            for one in order:
                nearest[one.mask] = one.id
            same(f"visible {group} of frame {frame.index} by depth", frame.labels(group, "top"), nearest)
            masks = sum(int(one.mask.sum()) for one in frame.of(group))
            occluded = masks - int(np.count_nonzero(frame.labels(group, frame.policy)))
            equal(f"occluded pixels of {group} in frame {frame.index}", frame.summary["occluded_px"][group], occluded)
    passed(
        f"shards/*.coco.json: pycocotools reads every mask, area and box of {objects} objects in {len(frames)} frames"
    )
    return frames


def check_tables(folder, frames, records):
    """Compares objects/*.csv with the annotations, row by row."""
    count = 0
    for record in records:
        with open(folder / f"objects/{record['shard']:06}.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        objects = [one for frame in frames if frame.shard == record["shard"] for one in frame.objects]
        equal(f"rows of shard {record['shard']}", len(rows), len(objects))
        for row, one in zip(rows, objects):
            annotation = one.annotation
            found = [int(row["image"]), int(row["id"]), row["part"], row["class"], int(row["area_px"])]
            expected = [annotation[key] for key in ["image_id", "object_id", "part", "class", "area"]]
            equal(f"row of {one.name}", found, expected)
            for key in ["depth_um", "mean_absorbance", "area_um2", "rotation_deg"]:
                equal(f"{key} of {one.name}", float(row[key]), annotation[key])
            for key in ["defocus_um", "detectability"]:
                equal(f"{key} of {one.name}", [float(v) for v in row[key].split(";")], annotation[key])
            count += 1
    passed(f"objects/*.csv: {count} rows equal the annotations")


def split(seed, what, number):
    """Returns the split with probabilities 0.8, 0.1 and 0.1."""
    word = hashlib.sha256(f"papsynth split {seed} {what} {number}".encode()).digest()[:4]
    return (["train"] * 8 + ["val", "test"])[int.from_bytes(word, "little") * 10 >> 32]


def check_splits(folder, frames, seed):
    with open(folder / "splits.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    expected = [
        {
            "image": str(frame.index),
            "slide": str(frame.summary["slide"]),
            "by_field": split(seed, "field", frame.index),
            "by_slide": split(seed, "slide", frame.summary["slide"]),
        }
        for frame in frames
    ]
    equal("splits.csv", rows, expected)
    passed(f"splits.csv: {len(rows)} frames, fields of a slide together")
    return {int(row["image"]): row for row in rows}


def check_folder(frames):
    """Reads images and label images with Pillow and tifffile."""
    for frame in frames:
        path = frame.folder / ("images" if frame.planes == 1 else "all-in-focus") / f"{frame.name}.png"
        with Image.open(path) as image:
            image.load()
            equal(f"size of {path}", image.size, frame.shape[::-1])
            per_metre = 1e6 / frame.summary["pixel_um"]
            # Pillow gives pixels per inch.
            check(np.allclose(image.info["dpi"], per_metre * 0.0254, rtol=1e-5), f"pHYs of {path}: {image.info['dpi']}")
            if frame.summary["bits"] <= 8 or not frame.colour:
                same(f"{path} by Pillow and by libpng", np.array(image), frame.picture())
        for group in GROUPS.values():
            path = frame.folder / f"labels/{group}/{frame.name}.tif"
            same(str(path), tifffile.imread(path).astype(np.int64), frame.labels(group, "top"))
            same(f"{path} by Pillow", np.array(Image.open(path)).astype(np.int64), frame.labels(group, "top"))
        layers = sum((one.mask.astype(int) for one in frame.of("cytoplasm")), np.zeros(frame.shape, int))
        same(
            f"layers of frame {frame.index}", tifffile.imread(frame.folder / f"labels/layers/{frame.name}.tif"), layers
        )
    passed(f"folder: Pillow, libpng and tifffile agree on images and labels of {len(frames)} frames")


def check_ome(path, frame, planes, channels):
    """Checks schema, sizes, axes and units of an OME-TIFF; returns its pixels and its model."""
    with tifffile.TiffFile(path) as file:
        check(file.is_ome, f"{path} is not an OME-TIFF for tifffile")
        xml = file.ome_metadata
        equal(f"series of {path}", len(file.series), 1)
        series = file.series[0]
        pixels, axes = series.asarray(), series.axes
        colour = pixels.shape[-1] == 3 and axes.endswith("S")
        equal(f"pages of {path}", len(file.pages), planes * (1 if colour else channels))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = ome_types.from_xml(xml, validate=True)
    equal(f"images of {path}", len(model.images), 1)
    typed = model.images[0].pixels
    sizes = [typed.size_x, typed.size_y, typed.size_z, typed.size_c, typed.size_t]
    equal(f"sizes of {path}", sizes, [*frame.shape[::-1], planes, channels, 1])
    equal(f"type of {path}", typed.type.value, str(pixels.dtype))
    for key in ["x", "y"]:
        equal(f"physical size {key} of {path}", getattr(typed, f"physical_size_{key}"), frame.summary["pixel_um"])
        equal(f"unit of {key} of {path}", getattr(typed, f"physical_size_{key}_unit").value, "µm")
    equal(f"samples of {path}", sum(channel.samples_per_pixel for channel in typed.channels), channels)
    expected_axes = (
        ("Z" if planes > 1 else "") + ("C" if channels > 1 and not colour else "") + "YX" + ("S" if colour else "")
    )
    equal(f"axes of {path}", axes, expected_axes)
    return pixels, typed


def check_ome_tiff(frames):
    layers = 0
    for frame in frames:
        path = frame.folder / f"ome-tiff/{frame.name}.ome.tif"
        pixels, typed = check_ome(path, frame, frame.planes, frame.summary["channels"])
        stack = frame.stack()
        same(str(path), pixels.reshape(stack.shape), stack)
        equal(f"significant bits of {path}", typed.significant_bits, frame.summary["bits"])
        if frame.planes > 1:
            planes_um = frame.summary["planes_um"]
            check(np.isclose(typed.physical_size_z, abs(planes_um[1] - planes_um[0])), f"step of {path}")
            equal(f"depths of {path}", [plane.position_z for plane in typed.planes], planes_um)
        for group in GROUPS.values():
            path = frame.folder / f"ome-tiff/{frame.name}.{group}.ome.tif"
            with tifffile.TiffFile(path) as file:
                count = len(file.pages)
            pixels, _ = check_ome(path, frame, 1, count)
            pixels = pixels.reshape(count, *frame.shape)
            layers += count
            for one in frame.of(group):
                shown = [np.array_equal(layer == one.id, one.mask) for layer in pixels]
                hidden = [not (layer == one.id).any() for layer in pixels]
                if one.mask.any():
                    equal(f"layers of {path} with all of {one.name}", sum(shown), 1)
                    equal(f"layers of {path} without {one.name}", sum(hidden), count - 1)
                    area = max(int((layer == one.id).sum()) for layer in pixels)
                    equal(f"area of {one.name} in {path}", area, int(rle.area(one.annotation["segmentation"])))
            known = {one.id for one in frame.of(group)} | {0}
            check(set(np.unique(pixels).tolist()) <= known, f"{path} has unknown objects")
    passed(
        f"ome-tiff: schema, axes, µm and pixels of {len(frames)} images; {layers} label layers have every complete mask"
    )


def keep(key, data):
    """Decodes PNG and TIFF without conversion: the image decoders of webdataset return 8 bits."""
    if key.endswith("png"):
        return imagecodecs.png_decode(data)
    if key.endswith("tif"):
        return tifffile.imread(io.BytesIO(data))
    return None


def check_webdataset(folder, frames, records, splits):
    urls = [str(folder / f"webdataset/{record['shard']:06}.tar") for record in records]
    samples = list(webdataset.WebDataset(urls, shardshuffle=False).decode(keep))
    equal("keys of samples", [sample["__key__"] for sample in samples], [frame.name for frame in frames])
    for sample, frame in zip(samples, frames):
        name = f"sample {frame.name}"
        keys = {key for key in sample if not key.startswith("__")}
        images = {"png"} if frame.planes == 1 else {"ome.tif", "all-in-focus.png"}
        equal(f"parts of {name}", keys, {"json", *images, *(f"{group}.png" for group in FLAT)})
        if frame.planes == 1:
            same(f"png of {name}", sample["png"], frame.at_8_bits(frame.picture()))
        else:
            same(f"ome.tif of {name}", sample["ome.tif"], frame.at_8_bits(frame.stack()))
            same(f"all-in-focus.png of {name}", sample["all-in-focus.png"], frame.at_8_bits(frame.picture()))
        for group in FLAT:
            equal(f"type of {group}.png of {name}", sample[f"{group}.png"].dtype, np.dtype("u2"))
            same(f"{group}.png of {name}", sample[f"{group}.png"].astype(np.int64), frame.labels(group, frame.policy))
        if frame.policy == "top":
            tiff = tifffile.imread(folder / f"labels/nucleus/{frame.name}.tif")
            same(f"nucleus.png of {name} and labels/nucleus", sample["nucleus.png"], tiff)
        head = sample["json"]
        equal(f"summary of {name}", head["frame"], frame.summary)
        row = splits[frame.index]
        equal(f"split of {name}", head["split"], {"field": row["by_field"], "slide": row["by_slide"]})
        annotations = head["truth"]["annotations"]
        equal(f"annotations of {name}", len(annotations), len(frame.objects))
        for found, one in zip(annotations, frame.objects):
            ids = ["id", "parent_id"]
            for key in one.annotation.keys() - ids:
                expected = one.annotation[key]
                equal(f"{key} of {one.name} in {name}", found[key], expected)
    # The decoder of webdataset reads images as they are.
    if frames[0].planes == 1:
        own = next(iter(webdataset.WebDataset(urls, shardshuffle=False).decode("rgb8")))
        picture = frames[0].at_8_bits(frames[0].picture())
        same("png by webdataset's own decoder", own["png"], picture if frames[0].colour else np.dstack([picture] * 3))
    read = f"{len(samples)} samples in {len(urls)} tar files"
    passed(f"webdataset: {read}, pixels, labels and ground truth as in other formats")


def check_pairs(what, frame, group, image, masks):
    """Checks an image and its labels."""
    same(f"{what} of frame {frame.index}", tifffile.imread(image), frame.at_8_bits(frame.picture()))
    labels = tifffile.imread(masks)
    check(labels.dtype in (np.uint16, np.uint32), f"{masks} has the type {labels.dtype}")
    same(str(masks), labels.astype(np.int64), frame.labels(group, frame.policy))


def check_cellpose(folder, frames):
    """Checks the rules of Cellpose: each image whose name does not end in `_masks` has a `NAME_masks` (cellpose.io)."""
    for group in FLAT:
        here = folder / "cellpose" / group
        files = sorted(path for path in here.iterdir() if path.suffix in (".png", ".jpg", ".jpeg", ".tif", ".tiff"))
        images = [path for path in files if not path.stem.endswith(("_masks", "_cp_masks", "_flows", "_cp_output"))]
        equal(f"images in {here}", [path.stem for path in images], [frame.name for frame in frames])
        equal(f"files in {here}", len(files), 2 * len(images))
        for image, frame in zip(images, frames):
            check_pairs(f"cellpose/{group}", frame, group, image, here / f"{image.stem}_masks.tif")
    passed(f"cellpose: {len(FLAT) * len(frames)} images with their masks, policy {frames[0].policy}")


def check_stardist(folder, frames):
    """Checks the rules of StarDist: images/ and masks/ with the same names, integer labels, 0 is background."""
    for group in FLAT:
        here = folder / "stardist" / group
        images, masks = (sorted(path.name for path in (here / part).glob("*.tif")) for part in ["images", "masks"])
        equal(f"names in {here}", masks, images)
        equal(f"images in {here}", [name[:6] for name in images], [frame.name for frame in frames])
        for name, frame in zip(images, frames):
            check_pairs(f"stardist/{group}", frame, group, here / "images" / name, here / "masks" / name)
    passed(f"stardist: {len(FLAT) * len(frames)} images with their masks, policy {frames[0].policy}")


def filled(rings, shape):
    """Fills rings along rows and columns by the even-odd rule. A seam is passed in both directions and cancels."""
    crossings = np.zeros((shape[0], shape[1] + 1), np.uint8)
    for ring in rings:
        for (x0, y0), (x1, y1) in zip(ring, [*ring[1:], ring[0]]):
            if x0 == x1:
                crossings[min(y0, y1) : max(y0, y1), x0] ^= 1
    return np.bitwise_xor.accumulate(crossings, axis=1)[:, :-1].astype(bool)


def twice_area(ring):
    """Returns twice the area, by the shoelace formula."""
    x, y = np.asarray(ring, np.int64).T
    return int((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def check_yolo(folder, frames, splits, categories):
    """Checks the rules of Ultralytics: names of files, class and fractions of objects, at least three corners.

    Files are labels/SPLIT/NAME.txt and images/SPLIT/NAME.png.
    """
    here = folder / "yolo-seg"
    text = (here / "data.yaml").read_text()
    names = [json.loads(name) for name in re.findall(r"^  \d+: (.*)$", text, re.M)]
    equal("names in data.yaml", names, [category["name"] for category in categories])
    numbers = {category["id"]: number for number, category in enumerate(categories)}
    # Ultralytics resolves a relative path against the current folder; without a path it uses the folder of the file.
    check("path:" not in text, "data.yaml has a path")
    folders = dict(re.findall(r"^(train|val|test): (images/\w+)$", text, re.M))
    parts = {row["by_slide"] for row in splits.values()}
    equal("splits in data.yaml", set(folders), {"train", "val"} | parts)
    for part, path in folders.items():
        check((here / path).is_dir(), f"{path} of data.yaml does not exist")
        check(part not in parts or path == f"images/{part}", f"the folder of {part} in data.yaml is {path}")
    found = sorted(path.relative_to(here / "labels").as_posix() for path in (here / "labels").rglob("*.txt"))
    equal("label files", found, sorted(f"{splits[f.index]['by_slide']}/{f.name}.txt" for f in frames))
    pictures = sorted(path.relative_to(here / "images").as_posix() for path in (here / "images").rglob("*.png"))
    equal("images", pictures, [name.replace(".txt", ".png") for name in found])
    lines = 0
    for frame in frames:
        place = f"{splits[frame.index]['by_slide']}/{frame.name}"
        same(
            f"image {place}",
            imagecodecs.png_decode((here / f"images/{place}.png").read_bytes()),
            frame.at_8_bits(frame.picture()),
        )
        rows = [line.split() for line in (here / f"labels/{place}.txt").read_text().splitlines()]
        shown = [one for one in frame.objects if one.mask.any()]
        equal(f"lines of {place}", len(rows), len(shown))
        for row, one in zip(rows, shown):
            equal(f"class of {one.name}", int(row[0]), numbers[one.annotation["category_id"]])
            fractions = np.array(row[1:], float).reshape(-1, 2)
            check(len(fractions) >= 3 and len(row) > 6, f"{one.name} has {len(fractions)} corners")
            check((fractions >= 0).all() and (fractions <= 1).all(), f"corners of {one.name} are outside the image")
            corners = fractions * frame.shape[::-1]
            ring = np.rint(corners).astype(int).tolist()
            check(np.abs(corners - ring).max() < 0.05, f"corners of {one.name} are not pixel corners")
            equal(f"area of {one.name} by the shoelace formula", twice_area(ring), 2 * one.annotation["area"])
            same(f"polygon of {one.name}", filled([ring], frame.shape), one.mask)
            lines += 1
    passed(f"yolo-seg: {lines} polygons equal their masks, {len(names)} classes")


def rings_of(geometry):
    """Returns the rings of a GeoJSON geometry without the repeated last corner."""
    polygons = [geometry["coordinates"]] if geometry["type"] == "Polygon" else geometry["coordinates"]
    return [ring[:-1] for polygon in polygons for ring in polygon]


def check_geometry(geometry, one, shape_px):
    form = shape(geometry)
    check(form.is_valid, f"{one.name} is not a valid polygon: {shapely.is_valid_reason(form)}")
    equal(f"area of {one.name} by shapely", form.area, float(one.annotation["area"]))
    x, y, width, height = one.annotation["bbox"]
    equal(f"bounds of {one.name}", form.bounds, (x, y, x + width, y + height))
    same(f"polygon of {one.name}", filled(rings_of(geometry), shape_px), one.mask)
    return form


def check_qupath(folder, frames):
    """Checks GeoJSON of RFC 7946 and QuPath: valid polygons for shapely, nuclei within cells."""
    ids, nuclei = Counter(), 0
    for frame in frames:
        path = folder / f"qupath/{frame.name}.ome.tif"
        pixels, _ = check_ome(path, frame, 1, frame.summary["channels"])
        same(str(path), pixels, frame.picture())
        collection = read_json(folder / f"qupath/{frame.name}.geojson")
        equal(f"type of qupath/{frame.name}.geojson", collection["type"], "FeatureCollection")
        by_id = {(one.id, one.group): one for one in frame.objects}
        left = {key for key, one in by_id.items() if one.mask.any()}
        for feature in collection["features"]:
            ids[str(uuid.UUID(feature["id"]))] += 1
            number, properties = int(feature["properties"]["name"]), feature["properties"]
            cell = properties["objectType"] == "cell"
            check(
                properties["objectType"] in ("cell", "detection"), f"{properties['objectType']} is not a type of QuPath"
            )
            parts = ["cytoplasm"] if cell else ["nucleus", "debris"]
            one = next(by_id[number, part] for part in parts if (number, part) in left)
            left.remove((one.id, one.group))
            form = check_geometry(feature["geometry"], one, frame.shape)
            measured = properties["measurements"]["Area µm^2"]
            equal(f"measured area of {one.name}", measured, one.annotation["area_um2"])
            expected = one.annotation["class"] if cell else frame.coco.cats[one.annotation["category_id"]]["name"]
            equal(f"class of {one.name}", properties["classification"]["name"], expected)
            if "nucleusGeometry" in feature:
                nuclei += 1
                check(cell, f"{one.name} is not a cell but has a nucleus")
                nucleus = by_id[number, "nucleus"]
                left.discard((nucleus.id, "nucleus"))
                inner = check_geometry(feature["nucleusGeometry"], nucleus, frame.shape)
                outer = shapely.box(*form.bounds)
                check(
                    outer.covers(inner),
                    f"{nucleus.name} is outside the bounds of its cell: {inner.bounds}, {form.bounds}",
                )
        equal(f"objects of frame {frame.index} without a feature", sorted(left), [])
    equal("names of several features", [name for name, count in ids.items() if count > 1], [])
    passed(f"qupath: {len(ids)} features with valid polygons equal to their masks, {nuclei} nuclei within their cells")


def check_croissant(folder, manifest):
    """Checks files, hashes and columns, without a reader of Croissant."""
    card = read_json(folder / "croissant.json")
    listed = {entry["path"]: entry for entry in manifest["files"]}
    for file in card["distribution"]:
        if file["@type"] == "cr:FileObject":
            equal(f"sha256 of {file['@id']}", file["sha256"], listed[file["contentUrl"]]["sha256"])
    columns = 0
    for fields in card["recordSet"]:
        for field in fields["field"]:
            source = field["source"]
            paths = [source["fileObject"]["@id"]] if "fileObject" in source else None
            if paths is None:
                sets = {entry["@id"]: entry["includes"] for entry in card["distribution"] if "includes" in entry}
                paths = [p.relative_to(folder).as_posix() for p in folder.glob(sets[source["fileSet"]["@id"]])]
                check(paths, f"{source['fileSet']['@id']} has no files")
            # external_full.py checks Parquet.
            for path in [path for path in paths if not path.endswith(".parquet")]:
                with open(folder / path, newline="") as file:
                    header = next(csv.reader(file))
                check(source["extract"]["column"] in header, f"{path} has no column {source['extract']['column']}")
            columns += 1
    passed(f"croissant.json: hashes of {len(card['distribution'])} entries, {columns} columns exist")


def check_pages(folder, pages):
    """Runs the Python code of the pages on formats."""
    for page in sorted(pages.glob("*.md")):
        for block in re.findall(r"^```python\n(.*?)^```", page.read_text(), re.M | re.S):
            with contextlib.redirect_stdout(None):
                exec(compile(block, str(page), "exec"), {"DIR": str(folder)})
            passed(f"the Python code of {page.name} runs")


def check_tiffs(folder):
    """Checks that TIFF files are uncompressed or zlib without predictor, as ImageJ reads them without plugins."""
    paths = sorted(folder.rglob("*.tif"))
    for path in paths:
        with tifffile.TiffFile(path) as file:
            for page in file.pages:
                plain = page.predictor == 1 and page.compression.name in ("NONE", "ADOBE_DEFLATE")
                check(plain, f"{path} has a compression that ImageJ does not read")
    passed(f"{len(paths)} TIFF files can be read by ImageJ")


def main(folder, pages=None):
    manifest, records = check_manifest(folder)
    frames = check_truth(folder, records)
    check_tables(folder, frames, records)
    splits = check_splits(folder, frames, manifest["identity"]["seed"])
    check_folder(frames)
    check_ome_tiff(frames)
    check_tiffs(folder)
    check_webdataset(folder, frames, records, splits)
    check_cellpose(folder, frames)
    check_stardist(folder, frames)
    check_yolo(folder, frames, splits, manifest["categories"])
    check_qupath(folder, frames)
    check_croissant(folder, manifest)
    if pages is not None:
        check_pages(folder, pages)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
