"""Reads the OME-Zarr groups of a data set with the formats folder and ome-zarr with zarr-python, tensorstore,
ome-zarr-models, ome-zarr and the reader of napari: every pixel of every level, every mask of every object.

Usage: python external_zarr.py DIR PAGES

Needs zarr, tensorstore, ome-zarr-models, ome-zarr, napari-ome-zarr and the packages of external_formats.py. Prints a
line for each check and exits with status 1 at the first failure.
"""

import contextlib
import io
import re
import sys
import warnings
from pathlib import Path

import numpy as np
import tensorstore
import zarr
from napari_ome_zarr import napari_get_reader
from ome_zarr.io import parse_url
from ome_zarr.reader import Reader
from ome_zarr_models.v05.image import Image
from ome_zarr_models.v05.image_label import ImageLabel

from external import GROUPS, check, check_manifest, equal, passed
from external_formats import check_truth, same


def half(values):
    """Returns the rounded means of 2 x 2 values; an odd border is repeated."""
    rows, columns = values.shape[-2:]
    border = [(0, 0)] * (values.ndim - 2) + [(0, rows % 2), (0, columns % 2)]
    values = np.pad(values.astype(np.int64), border, mode="edge")
    return sum(values[..., y::2, x::2] for y in (0, 1) for x in (0, 1)) + 2 >> 2


def path_of(frame):
    return frame.folder / f"ome-zarr/{frame.name}.ome.zarr"


def expected(frame):
    """Returns the image of the format folder, with the axes c, z, y, x as needed."""
    stack = frame.stack()
    if frame.colour:
        stack = np.moveaxis(stack, -1, 0)
    return stack if frame.planes > 1 else stack.reshape(*stack.shape[:-3], *frame.shape)


def levels_of(group):
    return [entry["path"] for entry in group.attrs["ome"]["multiscales"][0]["datasets"]]


def check_zarr(frames):
    """Reads every level of images and labels with zarr-python and tensorstore."""
    arrays, layers, objects = 0, 0, 0
    for frame in frames:
        path = path_of(frame)
        group = zarr.open_group(path, mode="r")
        image = expected(frame)
        for level in levels_of(group):
            same(f"level {level} of {path}", group[level][:], image)
            equal(f"type of level {level} of {path}", group[level].dtype, expected(frame).dtype)
            spec = {"driver": "zarr3", "kvstore": {"driver": "file", "path": str(path / level)}}
            theirs = tensorstore.open(spec, read=True).result()
            same(f"level {level} of {path} by tensorstore", np.array(theirs.read().result()), image)
            image = half(image).astype(image.dtype)
            arrays += 1
        longer = max(frame.shape)
        equal(
            f"levels of {path}", len(levels_of(group)), 1 if longer < 2048 else 1 + int(np.ceil(np.log2(longer / 512)))
        )
        shown = {part: [] for part in GROUPS.values()}
        names = group["labels"].attrs["ome"]["labels"]
        for name in names:
            labels = group["labels"][name]
            full = labels["0"][:]
            equal(f"levels of labels {name} of {path}", levels_of(labels), levels_of(group))
            for number, level in enumerate(levels_of(labels)):
                same(f"level {level} of labels {name} of {path}", labels[level][:], full[:: 2**number, :: 2**number])
            known = labels.attrs["ome"]["image-label"].get("properties", [])
            equal(
                f"labels {name} of {path} with properties",
                {row["label-value"] for row in known},
                set(np.unique(full).tolist()) - {0},
            )
            shown[name.rsplit("-", 1)[0]].append((full, {row["label-value"]: row for row in known}))
            layers += 1
        for one in frame.objects:
            here = [(full == one.id, known) for full, known in shown[one.group] if one.id in known]
            equal(f"layers of {path} with {one.name}", len(here), 1 if one.mask.any() else 0)
            for mask, known in here:
                same(f"{one.name} in {path}", mask, one.mask)
                row, annotation = known[one.id], one.annotation
                equal(f"area of {one.name} in {path}", [row["area_px"], int(mask.sum())], [annotation["area"]] * 2)
                for key in ["class", "bethesda", "kind", "depth_um", "mean_absorbance", "area_um2", "truncated"]:
                    equal(f"{key} of {one.name} in {path}", row[key], annotation[key])
                equal(
                    f"category of {one.name} in {path}",
                    row["category"],
                    frame.coco.cats[annotation["category_id"]]["name"],
                )
                parent = annotation["parent_id"] and frame.coco.anns[annotation["parent_id"]]["object_id"]
                equal(f"parent of {one.name} in {path}", row["parent"], parent)
                objects += 1
    masks = f"{layers} label layers have {objects} complete masks"
    passed(f"ome-zarr: zarr-python and tensorstore read {arrays} levels pixel by pixel, {masks}")


def check_models(frames):
    """Validates the documents with ome-zarr-models."""
    for frame in frames:
        group = zarr.open_group(path_of(frame), mode="r")
        image = Image.from_zarr(group)
        (scales,) = image.attributes.ome.multiscales
        names = ["c"] * frame.colour + ["z"] * (frame.planes > 1) + ["y", "x"]
        equal(f"axes of {path_of(frame)}", [axis.name for axis in scales.axes], names)
        units = {axis.name: axis.unit for axis in scales.axes if axis.type == "space"}
        equal(f"units of {path_of(frame)}", set(units.values()), {"micrometer"})
        for number, dataset in enumerate(scales.datasets):
            scale = dict(zip(names, dataset.coordinateTransformations[0].scale))
            pixel = frame.summary["pixel_um"] * 2**number
            equal(f"pixels of level {number} of {path_of(frame)}", [scale["y"], scale["x"]], [pixel, pixel])
            if frame.planes > 1:
                planes = frame.summary["planes_um"]
                check(np.isclose(scale["z"], planes[1] - planes[0]), f"step of {path_of(frame)}")
        for name in group["labels"].attrs["ome"]["labels"]:
            ImageLabel.from_zarr(group["labels"][name])
        equal(f"channels of {path_of(frame)}", len(image.attributes.ome.omero["channels"]), frame.summary["channels"])
    passed(f"ome-zarr: ome-zarr-models finds {len(frames)} images and their labels valid")


def check_readers(frames):
    """Reads images and label layers with ome-zarr and the reader of napari, in µm."""
    layers = 0
    for frame in frames:
        path, image = path_of(frame), expected(frame)
        names = zarr.open_group(path, mode="r")["labels"].attrs["ome"]["labels"]
        # ome-zarr prints progress.
        with warnings.catch_warnings(), contextlib.redirect_stdout(None):
            warnings.simplefilter("ignore")
            nodes = list(Reader(parse_url(path, mode="r"))())
            same(f"{path} by ome-zarr", np.asarray(nodes[0].data[0]), image)
            found = napari_get_reader(str(path))(str(path))
        pictures = [layer for layer in found if layer[2] == "image"]
        equal(f"images of {path} for napari", len(pictures), 1)
        for data, about, _ in pictures:
            same(f"{path} for napari", np.asarray(data[0]), image)
            equal(f"scale of {path} for napari", list(about["scale"])[-2:], [frame.summary["pixel_um"]] * 2)
            equal(f"axis of channels of {path} for napari", about.get("channel_axis"), 0 if frame.colour else None)
            equal(f"units of {path} for napari", set(about["units"]), {"micrometer"})
        labels = [layer for layer in found if layer[2] == "labels"]
        equal(f"label layers of {path} for napari", len(labels), len(names))
        group = zarr.open_group(path, mode="r")
        for (data, _, _), name in zip(labels, names):
            same(f"labels {name} of {path} for napari", np.asarray(data[0]), group["labels"][name]["0"][:])
            layers += 1
    passed(f"ome-zarr: ome-zarr reads {len(frames)} images, the reader of napari also {layers} label layers")


def check_pages(folder, pages):
    """Runs the Python code of the page on this format."""
    for block in re.findall(r"^```python zarr\n(.*?)^```", (pages / "ome-zarr.md").read_text(), re.M | re.S):
        with contextlib.redirect_stdout(io.StringIO()):
            exec(compile(block, "ome-zarr.md", "exec"), {"DIR": str(folder)})
        passed("the Python code of ome-zarr.md runs")


def main(folder, pages):
    _, records = check_manifest(folder)
    frames = check_truth(folder, records)
    check_zarr(frames)
    check_models(frames)
    check_readers(frames)
    check_pages(folder, pages)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
