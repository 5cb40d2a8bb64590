"""Checks a data set in all formats with readers that take longer to install than those of external_formats.py.

Usage: python external_full.py DIR PAGES [JAR]

DIR was written by a program built with the feature `parquet`, with the format huggingface. Needs mlcroissant, datasets,
pyarrow, opencv-python-headless and the packages of external_formats.py. JAR is the package of Bio-Formats, the reader
of Fiji and QuPath; it needs Java. Prints a line for each check and exits with status 1 at the first failure.
"""

import contextlib
import csv
import io
import json
import logging
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import datasets
import imagecodecs
import mlcroissant
import numpy as np
import pyarrow.parquet as pq
import tifffile
from PIL import Image
from pycocotools import mask as rle

from external import check, check_manifest, equal, passed
from external_formats import check_truth, same


def check_croissant(folder, frames):
    """Checks with mlcroissant, which compares SHA-256."""
    logging.getLogger("absl").setLevel(logging.ERROR)
    dataset = mlcroissant.Dataset(jsonld=folder / "croissant.json")
    issues = dataset.metadata.ctx.issues
    equal("errors of croissant.json", issues.errors, set())
    # There is no date, so that data sets of the same seed are equal.
    unexpected = [warning for warning in issues.warnings if "datePublished" not in warning]
    equal("warnings of croissant.json", unexpected, [])
    rows = list(dataset.records(record_set="splits"))
    equal("rows of splits", [row["splits/image"] for row in rows], [frame.index for frame in frames])
    count = sum(1 for _ in dataset.records(record_set="objects"))
    equal("rows of objects", count, sum(len(frame.objects) for frame in frames))
    rows = sorted(dataset.records(record_set="frames"), key=lambda row: row["frames/index"])
    sizes = [(row["frames/index"], row["frames/height"], row["frames/width"]) for row in rows]
    equal("rows of frames", sizes, [(frame.index, *frame.shape) for frame in frames])
    sets = {
        entry["@id"]
        for entry in json.loads((folder / "croissant.json").read_text())["distribution"]
        if entry["@type"] == "cr:FileSet"
    }
    check({"webdataset", "huggingface"} <= sets, f"croissant.json has the sets {sets}")
    with tempfile.TemporaryDirectory() as copy:
        for name in ["croissant.json", "splits.csv"]:
            (Path(copy) / name).write_bytes((folder / name).read_bytes())
        (Path(copy) / "splits.csv").write_text("image,slide,by_field,by_slide\n")
        try:
            list(mlcroissant.Dataset(jsonld=Path(copy) / "croissant.json").records(record_set="splits"))
            check(False, "mlcroissant accepts a file with another SHA-256")
        except Exception as error:
            reason = f"{error} {error.__cause__}"
            check("hash" in reason.lower(), f"mlcroissant says {reason}")
    passed("croissant.json: mlcroissant finds no error and checks the SHA-256")


def check_datasets(folder, frames):
    """Reads the tar files with `datasets`, which decodes images with Pillow."""
    with tempfile.TemporaryDirectory() as cache:
        files = sorted(str(path) for path in folder.glob("webdataset/*.tar"))
        data = datasets.load_dataset("webdataset", data_files={"train": files}, split="train", cache_dir=cache)
        equal("rows of datasets", [row["__key__"] for row in data], [frame.name for frame in frames])
        for row, frame in zip(data, frames):
            equal(f"summary of {frame.name} by datasets", row["json"]["frame"]["index"], frame.index)
            picture = row["png"] if frame.planes == 1 else row["all-in-focus.png"]
            same(f"image {frame.name} by datasets", np.array(picture), frame.at_8_bits(frame.picture()))
            labels = np.array(row["nucleus.png"]).astype(np.int64)
            same(f"nucleus.png {frame.name} by datasets", labels, frame.labels("nucleus", frame.policy))
    passed(f"webdataset: datasets reads {len(frames)} rows")


def check_tables(folder, frames, records):
    """Compares the Parquet tables with the CSV (pyarrow), and their masks with COCO (pycocotools)."""
    count = 0
    names = [f"objects/{record['shard']:06}" for record in records]
    for name in names + ["objects"] * (folder / "objects.parquet").exists():
        table = pq.read_table(folder / f"{name}.parquet")
        with open(folder / f"{name}.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        equal(f"rows of {name}.parquet", table.num_rows, len(rows))
        check(table.column_names[: len(rows[0])] == list(rows[0]), f"columns of {name}.parquet: {table.column_names}")
        by_place = {(frame.index, one.id, one.annotation["part"]): one for frame in frames for one in frame.objects}
        for found, row in zip(table.to_pylist(), rows):
            for key, text in row.items():
                value = found[key]
                if isinstance(value, list):
                    equal(f"{key} in {name}.parquet", value, [float(v) for v in text.split(";")])
                elif isinstance(value, bool):
                    equal(f"{key} in {name}.parquet", str(value).lower(), text)
                else:
                    equal(f"{key} in {name}.parquet", value, type(value)(text) if value is not None else text or None)
            one = by_place[found["image"], found["id"], found["part"]]
            size = [found["image_height_px"], found["image_width_px"]]
            for key, area, written in [
                ("rle", "area_px", "segmentation"),
                ("visible_rle", "visible_area_px", "visible"),
            ]:
                counts = one.annotation[written]["counts"]
                counts = counts.decode() if isinstance(counts, bytes) else counts
                equal(f"{key} of {one.name} in {name}.parquet", found[key], counts)
                equal(f"area of {key} of {one.name}", int(rle.area({"size": size, "counts": found[key]})), found[area])
            count += 1
    passed(f"objects/*.parquet: pyarrow reads {count} rows equal to the CSV, run lengths equal to COCO")


def check_huggingface(folder, frames, categories, splits):
    """Reads the folder with `datasets`: images, planes and objects by split."""
    names = {"train": "train", "val": "validation", "test": "test"}
    by_index = {frame.index: frame for frame in frames}
    expected = {}
    for frame in frames:
        expected.setdefault(names[splits[frame.index]], []).append(frame.index)
    with tempfile.TemporaryDirectory() as cache:
        # With the card, and from the files alone.
        files = {}
        for path in sorted(folder.glob("huggingface/data/*.parquet")):
            files.setdefault(path.name.split("-")[0], []).append(str(path))
        ways = [
            datasets.load_dataset(str(folder / "huggingface"), cache_dir=f"{cache}/card"),
            datasets.load_dataset("parquet", data_files=files, cache_dir=f"{cache}/files"),
        ]
        for data in ways:
            equal("splits of datasets", {name: part["index"] for name, part in data.items()}, expected)
            for name, part in data.items():
                check(
                    isinstance(part.features["image"], datasets.Image),
                    f"the image of {name} is {part.features['image']}",
                )
                classes = part.features["objects"].feature["category"].names
                equal(f"classes of {name}", classes, [category["name"] for category in categories])
                raw = part.cast_column("image", datasets.Image(decode=False))
                for row, bare in zip(part, raw):
                    check_row(row, bare, by_index[row["index"]], categories)
    read = f"{len(frames)} frames in {len(expected)} splits"
    passed(f"huggingface: datasets reads {read}, pixels, areas and run lengths as in other formats")


def check_row(row, bare, frame, categories):
    what = f"row of frame {frame.index}"
    check(isinstance(row["image"], Image.Image), f"the image of {what} is {type(row['image'])}")
    same(f"image of {what}", imagecodecs.png_decode(bare["image"]["bytes"]), frame.at_8_bits(frame.picture()))
    same(f"image of {what} by Pillow", np.array(row["image"]), frame.at_8_bits(frame.picture()))
    planes = frame.stack() if frame.planes > 1 else []
    equal(f"planes of {what}", len(row["planes"]), len(planes))
    for plane, expected in zip(row["planes"], planes):
        same(f"plane of {what}", np.array(plane), frame.at_8_bits(expected))
    equal(f"bits of {what}", [row["bits"], row["camera_bits"]], [frame.summary["training_bits"], frame.summary["bits"]])
    for key in ["slide", "width", "height", "pixel_um", "planes_um"]:
        equal(f"{key} of {what}", row[key], frame.summary[key])
    equal(f"objects of {what}", len(row["objects"]), len(frame.objects))
    for found, one in zip(row["objects"], frame.objects):
        annotation = one.annotation
        keys = [
            "part",
            "kind",
            "class",
            "bethesda",
            "traits",
            "semantic_class",
            "cluster",
            "bbox",
            "area",
            "visible_area",
        ]
        keys += ["area_um2", "depth_um", "mean_absorbance", "tint", "truncated"]
        for key in keys:
            equal(f"{key} of {one.name} in {what}", found[key], annotation[key])
        equal(f"id of {one.name} in {what}", found["id"], one.id)
        equal(f"ignored of {one.name} in {what}", found["ignored"], annotation["iscrowd"] == 1)
        equal(f"category of {one.name}", categories[found["category"]]["id"], annotation["category_id"])
        for key, written in [("rle", "segmentation"), ("visible_rle", "visible")]:
            counts = annotation[written]["counts"]
            equal(
                f"{key} of {one.name} in {what}", found[key], counts.decode() if isinstance(counts, bytes) else counts
            )
        area = int(rle.area({"size": list(frame.shape), "counts": found["rle"]}))
        equal(f"area of {one.name} in {what}", area, annotation["area"])


def check_opencv(folder, frames):
    """Fills polygons of yolo-seg with OpenCV, as Ultralytics does. They differ from masks only under the outline."""
    lines = 0
    for frame in frames:
        (path,) = folder.glob(f"yolo-seg/labels/*/{frame.name}.txt")
        shown = [one for one in frame.objects if one.mask.any()]
        for line, one in zip(path.read_text().splitlines(), shown):
            corners = np.array(line.split()[1:], float).reshape(-1, 2) * frame.shape[::-1]
            drawn = np.zeros(frame.shape, np.uint8)
            cv2.fillPoly(drawn, [np.rint(corners).astype(np.int32)], 1)
            seams = np.zeros(frame.shape, np.uint8)
            cv2.polylines(seams, [np.rint(corners).astype(np.int32)], True, 1)
            # OpenCV also fills the pixels under the outline.
            off = (drawn.astype(bool) != one.mask) & (seams == 0)
            equal(f"pixels of {one.name} that differ in OpenCV", int(off.sum()), 0)
            lines += 1
    passed(f"yolo-seg: OpenCV fills {lines} polygons to their masks, except for the pixels under the outline")


def check_bio_formats(folder, frames, jar):
    """Converts every OME-TIFF with Bio-Formats and compares the result."""
    paths = sorted(
        [*folder.glob("ome-tiff/*.ome.tif"), *folder.glob("qupath/*.ome.tif"), *folder.glob("images/*.ome.tif")]
    )
    with tempfile.TemporaryDirectory() as out:
        for number, path in enumerate(paths):
            again = Path(out) / f"{number}.ome.tif"
            tool = ["java", "-cp", str(jar), "loci.formats.tools.ImageConverter", "-no-upgrade", str(path), str(again)]
            done = subprocess.run(tool, capture_output=True, text=True)
            equal(f"status of Bio-Formats for {path}: {done.stderr[-400:]}", done.returncode, 0)
            expected, found = tifffile.imread(path), tifffile.imread(again)
            if found.shape != expected.shape:
                # Bio-Formats writes channels as planes.
                found = np.moveaxis(found, -3, -1) if expected.shape[-1] == 3 else found
            same(f"{path} by Bio-Formats", found.reshape(expected.shape), expected)
            with tifffile.TiffFile(path) as source, tifffile.TiffFile(again) as copy:
                for key in [
                    "SizeX",
                    "SizeY",
                    "SizeZ",
                    "SizeC",
                    "SizeT",
                    "PhysicalSizeX",
                    "PhysicalSizeY",
                    "PhysicalSizeZ",
                ]:
                    values = [re.search(rf' {key}="([^"]*)"', file.ome_metadata) for file in (source, copy)]
                    values = [value and float(value[1]) for value in values]
                    equal(f"{key} of {path} by Bio-Formats", values[1], values[0])
    passed(f"Bio-Formats converts {len(paths)} OME-TIFFs with equal pixels and sizes")


def check_pages(folder, pages):
    """Runs the Python code of the pages on formats that needs these readers."""
    for page in sorted(pages.glob("*.md")):
        for block in re.findall(r"^```python full\n(.*?)^```", page.read_text(), re.M | re.S):
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(block, str(page), "exec"), {"DIR": str(folder)})
            passed(f"the Python code of {page.name} runs")


def main(folder, pages, jar=None):
    manifest, records = check_manifest(folder)
    frames = check_truth(folder, records)
    with open(folder / "splits.csv", newline="") as file:
        splits = {int(row["image"]): row["by_slide"] for row in csv.DictReader(file)}
    check_croissant(folder, frames)
    check_datasets(folder, frames)
    check_tables(folder, frames, records)
    check_huggingface(folder, frames, manifest["categories"], splits)
    check_opencv(folder, frames)
    if jar is not None:
        check_bio_formats(folder, frames, jar)
    check_pages(folder, pages)


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
