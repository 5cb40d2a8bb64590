"""Reads the formats cellpose and stardist with the loaders of these programs.

Usage: python external_trainers.py DIR...

Each DIR is a data set in the formats cellpose and stardist. Libraries for training are replaced by mocks, because
loaders do not need them. Prints a line for each check and exits with status 1 at the first failure.
"""

import sys
import warnings
from importlib.machinery import ModuleSpec
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import tifffile

from external import check, passed

warnings.filterwarnings("ignore")


class MockImporter:
    """Replaces libraries for training by mocks."""

    NAMES = ("torch", "torchvision", "segment_anything")

    def find_spec(self, name, path=None, target=None):
        return ModuleSpec(name, self) if name.split(".")[0] in self.NAMES else None

    def create_module(self, spec):
        module = MagicMock(name=spec.name)
        module.__path__, module.__spec__, module.__version__ = [], spec, "0"
        return module

    def exec_module(self, module):
        pass


sys.meta_path.append(MockImporter())

from cellpose.io import load_train_test_data  # noqa: E402
from csbdeep.data import RawData  # noqa: E402
from stardist.geometry import star_dist  # noqa: E402


def same(read, path, what):
    check(
        np.array_equal(np.squeeze(read), np.squeeze(tifffile.imread(path))), f"{what}: {path} is read without changes"
    )


def read_cellpose(folder):
    images, labels, names, *_ = load_train_test_data(str(folder), mask_filter="_masks")
    files = sorted(path for path in folder.glob("*.tif") if not path.stem.endswith("_masks"))
    check([Path(name) for name in names] == files and len(files) > 0, f"Cellpose finds all images of {folder}")
    for image, label, path in zip(images, labels, files):
        same(image, path, "Cellpose")
        same(label, path.with_name(f"{path.stem}_masks.tif"), "Cellpose")
    return len(files)


def is_grey(folder):
    """Whether images are grey. CSBDeep needs images and masks with the same axes."""
    return tifffile.imread(next(folder.glob("*/images/*.tif"))).ndim == 2


def read_stardist(folder):
    data = RawData.from_folder(str(folder), source_dirs=["images"], target_dir="masks", axes="YX", pattern="*.tif")
    files = sorted((folder / "masks").glob("*.tif"))
    check(data.size == len(files) > 0, f"CSBDeep finds all pairs of {folder}")
    found = sorted(data.generator(), key=lambda pair: pair[1].tobytes())
    masks = sorted((tifffile.imread(path) for path in files), key=lambda mask: mask.tobytes())
    for (_, mask, _, _), expected in zip(found, masks):
        check(np.array_equal(mask, expected), f"CSBDeep reads the masks of {folder} without changes")
        # StarDist learns the distances from each pixel of an object to its border.
        check(
            np.array_equal(star_dist(mask.astype(np.uint16), 8).max(axis=-1) > 0, mask > 0),
            "StarDist sees every object",
        )
    return len(files)


def main(folders):
    for folder in folders:
        groups = sorted(path for path in (folder / "cellpose").iterdir() if path.is_dir())
        count = sum(read_cellpose(group) for group in groups)
        passed(f"{folder.name}: Cellpose loads {count} images with their masks")
        if is_grey(folder / "stardist"):
            count = sum(read_stardist(folder / "stardist" / group.name) for group in groups)
            passed(f"{folder.name}: CSBDeep and StarDist load {count} images with their masks")


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
