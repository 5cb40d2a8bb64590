"""Compares simulated frames with the reference implementation of EMVA 1288.

Usage: python external_emva.py DIR...

Each DIR holds the output of the example `emva1288`. Requires numpy and emva1288 (1.0.2). Prints one line per check and
exits with status 1 at the first failure.
"""

import json
import logging
import sys
from pathlib import Path

import numpy as np

if not hasattr(np, "asfarray"):
    # NumPy 2 removed `asfarray`; the package still calls it.
    np.asfarray = lambda a, dtype=np.float64: np.asarray(a, dtype=dtype)

from emva1288 import process  # noqa: E402

# Name, measured value, relative tolerance.
CHECKS = [
    ("gain", lambda r: r.K, 0.01),
    ("quantum_efficiency", lambda r: r.QE / 100, 0.01),
    ("dark_noise", lambda r: r.sigma_d, 0.02),
    ("dsnu", lambda r: r.DSNU1288, 0.02),
    ("prnu", lambda r: r.PRNU1288 / 100, 0.02),
]


def measure(folder):
    frames = process.ParseEmvaDescriptorFile(str(folder / "frames.txt"), loglevel=logging.WARNING)
    images = process.LoadImageData(frames.images, loglevel=logging.WARNING)
    data = process.Data1288(images.data, loglevel=logging.WARNING)
    return process.Results1288(data.data, loglevel=logging.WARNING)


def main(folders):
    for folder in map(Path, folders):
        expected = json.loads((folder / "expected.json").read_text())
        results = measure(folder)
        for name, measured, tolerance in CHECKS:
            found, off = measured(results), measured(results) / expected[name] - 1
            line = f"{folder.name}: {name} {found:.5g}, {100 * off:+.2f} % of {expected[name]:.5g}"
            if not abs(off) < tolerance:
                print(f"FAILED: {line}; tolerance {100 * tolerance:g} %")
                sys.exit(1)
            print(f"ok: {line}")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1:])
