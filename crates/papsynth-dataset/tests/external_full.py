"""Checks a data set that holds all formats at once with heavier readers than external_formats.py.

Usage: python external_full.py DIR PAGES [JAR]

Needs mlcroissant, datasets, opencv-python-headless and what external_formats.py needs. JAR is the package of Bio-Formats, by
which Fiji and QuPath read; it runs where there is a Java. Prints a line for each check and ends with status 1 at the first
that fails.
"""

import contextlib
import io
import logging
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import datasets
import mlcroissant
import numpy as np
import tifffile
from PIL import Image

from external import check, check_manifest, equal, passed
from external_formats import check_truth, same


def check_croissant(folder, frames):
    """mlcroissant finds no error, and compares the SHA-256 of what it reads."""
    logging.getLogger("absl").setLevel(logging.ERROR)
    dataset = mlcroissant.Dataset(jsonld=folder / "croissant.json")
    issues = dataset.metadata.ctx.issues
    equal("errors of croissant.json", issues.errors, set())
    # A date would make two data sets of the same seed differ.
    unexpected = [warning for warning in issues.warnings if "datePublished" not in warning]
    equal("warnings of croissant.json", unexpected, [])
    rows = list(dataset.records(record_set="splits"))
    equal("rows of splits", [row["splits/image"] for row in rows], [frame.index for frame in frames])
    objects = [record for record in dataset.metadata.record_sets if record.name == "objects"]
    if objects:
        count = sum(1 for _ in dataset.records(record_set="objects"))
        equal("rows of objects", count, sum(len(frame.objects) for frame in frames))
    with tempfile.TemporaryDirectory() as copy:
        for name in ["croissant.json", "splits.csv"]:
            (Path(copy) / name).write_bytes((folder / name).read_bytes())
        (Path(copy) / "splits.csv").write_text("image,slide,by_field,by_slide\n")
        try:
            list(mlcroissant.Dataset(jsonld=Path(copy) / "croissant.json").records(record_set="splits"))
            check(False, "mlcroissant takes a file of another SHA-256")
        except Exception as error:
            reason = f"{error} {error.__cause__}"
            check("hash" in reason.lower(), f"mlcroissant says {reason}")
    passed("croissant.json: mlcroissant finds no error and checks the SHA-256")


def check_datasets(folder, frames):
    """Hugging Face reads the tar files, whose images it decodes with Pillow."""
    with tempfile.TemporaryDirectory() as cache:
        files = sorted(str(path) for path in folder.glob("webdataset/*.tar"))
        data = datasets.load_dataset("webdataset", data_files={"train": files}, split="train", cache_dir=cache)
        equal("rows of datasets", [row["__key__"] for row in data], [frame.name for frame in frames])
        for row, frame in zip(data, frames):
            equal(f"summary of {frame.name} by datasets", row["json"]["frame"]["index"], frame.index)
            picture = row["png"] if frame.planes == 1 else row["all-in-focus.png"]
            if frame.summary["bits"] <= 8:
                same(f"image {frame.name} by datasets", np.array(picture), frame.picture())
            labels = np.array(row["nucleus.png"]).astype(np.int64)
            same(f"nucleus.png {frame.name} by datasets", labels, frame.labels("nucleus", frame.policy))
    passed(f"webdataset: datasets reads {len(frames)} rows")


def check_opencv(folder, frames):
    """Polygons of yolo-seg as Ultralytics fills them: no pixel of the mask is left out, none beyond its neighbours drawn."""
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
            # Where the polygon runs, the pixel belongs to it for OpenCV.
            off = (drawn.astype(bool) != one.mask) & (seams == 0)
            equal(f"pixels of {one.name} that OpenCV fills otherwise", int(off.sum()), 0)
            lines += 1
    passed(f"yolo-seg: OpenCV fills {lines} polygons to their masks, but for the pixels under the outline")


def check_bio_formats(folder, frames, jar):
    """Bio-Formats reads every OME-TIFF without complaint; what it writes again is the same."""
    paths = sorted([*folder.glob("ome-tiff/*.ome.tif"), *folder.glob("qupath/*.ome.tif"), *folder.glob("images/*.ome.tif")])
    with tempfile.TemporaryDirectory() as out:
        for number, path in enumerate(paths):
            again = Path(out) / f"{number}.ome.tif"
            tool = ["java", "-cp", str(jar), "loci.formats.tools.ImageConverter", "-no-upgrade", str(path), str(again)]
            done = subprocess.run(tool, capture_output=True, text=True)
            equal(f"status of Bio-Formats for {path}: {done.stderr[-400:]}", done.returncode, 0)
            expected, found = tifffile.imread(path), tifffile.imread(again)
            if found.shape != expected.shape:
                # It writes channels as planes.
                found = np.moveaxis(found, -3, -1) if expected.shape[-1] == 3 else found
            same(f"{path} by Bio-Formats", found.reshape(expected.shape), expected)
            with tifffile.TiffFile(path) as ours, tifffile.TiffFile(again) as theirs:
                for key in ["SizeX", "SizeY", "SizeZ", "SizeC", "SizeT", "PhysicalSizeX", "PhysicalSizeY", "PhysicalSizeZ"]:
                    values = [re.search(rf' {key}="([^"]*)"', file.ome_metadata) for file in (ours, theirs)]
                    values = [value and float(value[1]) for value in values]
                    equal(f"{key} of {path} by Bio-Formats", values[1], values[0])
    passed(f"Bio-Formats reads and writes again {len(paths)} OME-TIFFs, pixels and sizes the same")


def check_pages(folder, pages):
    """The Python of the pages on formats that wants heavier readers runs."""
    for page in sorted(pages.glob("*.md")):
        for block in re.findall(r"^```python full\n(.*?)^```", page.read_text(), re.M | re.S):
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(block, str(page), "exec"), {"DIR": str(folder)})
            passed(f"the Python of {page.name} runs")


def main(folder, pages, jar=None):
    _, records = check_manifest(folder)
    frames = check_truth(folder, records)
    check_croissant(folder, frames)
    check_datasets(folder, frames)
    check_opencv(folder, frames)
    if jar is not None:
        check_bio_formats(folder, frames, jar)
    if (folder / "objects.csv").exists():
        check_pages(folder, pages)


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
