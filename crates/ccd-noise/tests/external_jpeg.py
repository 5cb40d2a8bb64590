"""Compares the JPEG step with images that Pillow saves and loads again.

Usage: python external_jpeg.py DIR

DIR holds the output of the example `jpeg`. Requires numpy and pillow. Prints one line per check and exits with status 1
at the first failure. With the library of the Independent JPEG Group or with libjpeg-turbo, no level differs. For other
libraries a difference of 2 is allowed.
"""

import io
import sys
from pathlib import Path

import numpy as np
from PIL import Image

SUBSAMPLING = {"444": 0, "422": 1, "420": 2}


def main(folder):
    for path in sorted(folder.glob("*_*.png")):
        kind, quality, *subsampling = path.stem.split("_")
        options = {"subsampling": SUBSAMPLING[subsampling[0]]} if subsampling else {}
        memory = io.BytesIO()
        Image.open(folder / f"{kind}.png").save(memory, "JPEG", quality=int(quality), **options)
        expected = np.asarray(Image.open(memory), dtype=int)
        found = np.asarray(Image.open(path), dtype=int)
        if found.shape != expected.shape:
            print(f"FAILED: {path.name} has shape {found.shape}, expected {expected.shape}")
            sys.exit(1)
        worst = abs(found - expected).max()
        if worst > 2:
            print(f"FAILED: {path.name} differs by {worst} levels, tolerance 2")
            sys.exit(1)
        print(f"ok: {path.name} differs by {worst} levels at most")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
