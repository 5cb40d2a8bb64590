"""Reads every pixel of every level and every mask of a slide with independent readers.

They are zarr-python, tensorstore, ome-zarr-models, pyarrow, pycocotools and shapely.

Usage: python external_slide.py DIR PAGE

DIR is a slide, PAGE the page whose Python code is run on it. Prints a line for each check and exits with status 1 at
the first failure.
"""

import csv
import json
import re
import sys
from pathlib import Path

import numpy as np
import pyarrow.dataset
import tensorstore
import zarr
from ome_zarr_models.v05.image import Image
from pycocotools import mask as coco
from shapely.geometry import shape

from external import check, passed

csv.field_size_limit(1 << 28)


def half(values):
    """Returns the rounded means of 2 x 2 values; an odd border is repeated."""
    rows, columns = values.shape
    values = np.pad(values.astype(np.int64), [(0, rows % 2), (0, columns % 2)], mode="edge")
    return sum(values[y::2, x::2] for y in (0, 1) for x in (0, 1)) + 2 >> 2


def read_table(folder):
    """Compares the Parquet tables with the CSV."""
    count = 0
    for path in sorted(folder.glob("*.parquet")):
        typed = pyarrow.dataset.dataset(path, format="parquet").to_table().to_pylist()
        with path.with_suffix(".csv").open() as file:
            texts = list(csv.DictReader(file))
        check(len(typed) == len(texts), "as many rows")
        for values, row in zip(typed, texts):
            check(list(values) == list(row), "the same columns")
            for name, value in values.items():
                if isinstance(value, float):
                    same = value == float(row[name])
                elif isinstance(value, list):
                    same = value == [float(number) for number in row[name].split(";")]
                elif isinstance(value, bool):
                    same = row[name] == str(value).lower()
                else:
                    same = row[name] == ("" if value is None else str(value))
                check(same, f"{name} is the same in both tables")
        count += len(typed)
    whole = pyarrow.dataset.dataset([str(path) for path in folder.glob("*.parquet")])
    check(count == whole.count_rows() > 0, "the files are one table")
    return count


def main(folder, page):
    group = zarr.open_group(folder / "slide.ome.zarr", mode="r")
    Image.from_zarr(group)
    levels = [entry["path"] for entry in group.attrs["ome"]["multiscales"][0]["datasets"]]
    check(len(levels) > 2, "a slide has several levels")
    whole = [group[level][:] for level in levels]
    for above, below in zip(whole, whole[1:]):
        check(np.array_equal(half(above), below), "a level is the mean of the one before")
    spec = {"driver": "zarr3", "kvstore": {"driver": "file", "path": str(folder / "slide.ome.zarr/0")}}
    check(np.array_equal(tensorstore.open(spec).result().read().result(), whole[0]), "tensorstore reads the same")
    passed(f"zarr-python, tensorstore, ome-zarr-models: {len(levels)} levels of {whole[0].shape}")

    labels = {}
    for name in group["labels"].attrs["ome"]["labels"]:
        arrays = [group[f"labels/{name}/{level}"][:] for level in levels]
        for above, below in zip(arrays, arrays[1:]):
            check(np.array_equal(above[::2, ::2], below), f"a level of {name} is every other pixel of the one before")
        labels[name] = arrays[0]
    rows = read_table(folder / "objects")
    passed(f"pyarrow: {rows} rows with the values of the CSV")
    layers = np.zeros(labels["layers"].shape, dtype=np.int64)
    known, outlines = {}, {}
    for table in sorted((folder / "objects").glob("*.csv")):
        for row in csv.DictReader(table.open()):
            key = row["part"], int(row["id"])
            check(key not in known, "every object has one row")
            x, y, w, h = (int(row[f"bbox_{side}_px"]) for side in ("x", "y", "width", "height"))
            mask = coco.decode({"size": [h, w], "counts": row["rle"]}).astype(bool)
            check(mask.sum() == int(row["area_px"]), "a mask has its area")
            check(mask[0].any() and mask[-1].any() and mask[:, 0].any() and mask[:, -1].any(), "a box is tight")
            known[key] = mask.sum()
            group_of = "debris" if row["part"] == "whole" else row["part"]
            check(np.all(labels[group_of][y : y + h, x : x + w][mask] > 0), "labels cover every mask")
            if row["part"] == "cytoplasm":
                layers[y : y + h, x : x + w] += mask
        for feature in json.loads(table.with_suffix(".geojson").read_text())["features"]:
            outline = shape(feature["geometry"])
            check(outline.is_valid, "outlines are valid")
            cell = feature["properties"]["objectType"] == "cell"
            name = int(feature["properties"]["name"])
            outlines["cytoplasm" if cell else "other", name] = outline.area
            if cell and "nucleusGeometry" in feature:
                outlines["nucleus", name] = shape(feature["nucleusGeometry"]).area
    for (part, number), area in known.items():
        found = outlines.get((part, number), outlines.get(("other", number)))
        check(found == area, f"the outline of {part} {number} has the area of its mask")
    check(np.all(labels["layers"] >= layers), "layers count every cytoplasm")
    check(np.any(layers > 1), "some overlap")
    passed(f"pycocotools, shapely: {len(known)} masks and outlines on {len(labels)} label images")

    for block in re.findall(r"```python\n(.*?)```", page.read_text(), re.S):
        exec(compile(block, page.name, "exec"), {"DIR": str(folder)})
    passed("the code of the page runs")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
