"""Prints the table of `cargo xtask worth --overlap`: Dice of overlapping cells and share of missed ones by test set.

    overlap_table.py FOLDER

FOLDER has a file of overlap_net.py for each training. Intervals of 95 % are bootstraps over fields, with all trainings
of each field.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

DRAWS = 2000


def measures(fields):
    """Return the mean Dice coefficient of the found cells, the share of missed cells, and the share of false masks."""
    cells, masks, false = (sum(field[name] for field in fields) for name in ("cells", "masks", "false"))
    dice = [value for field in fields for value in field["dice"]]
    return np.mean(dice or [0]), 1 - len(dice) / max(cells, 1), false / max(masks, 1)


def main():
    tests, trainings = defaultdict(lambda: defaultdict(list)), 0
    for file in sorted(Path(sys.argv[1]).glob("*.json")):
        trainings += 1
        for test, fields in json.loads(file.read_text())["tests"].items():
            for field in fields:
                tests[Path(test).name][field["field"]].append(field)
    print("tested on | trainings | fields | cells | Dice of found cells | missed cells | false masks")
    print("---|" * 6 + "---")
    for test, fields in tests.items():
        rng, fields = np.random.default_rng(0), list(fields.values())
        draws = [
            measures([f for i in rng.integers(len(fields), size=len(fields)) for f in fields[i]]) for _ in range(DRAWS)
        ]
        means = measures([f for field in fields for f in field])
        lows, highs = np.quantile(draws, (0.025, 0.975), axis=0)
        parts = [f"{mean:.3f} ({low:.3f} to {high:.3f})" for mean, low, high in zip(means, lows, highs)]
        cells = sum(field[0]["cells"] for field in fields)
        print(" | ".join([test, str(trainings), str(len(fields)), str(cells), *parts]))


if __name__ == "__main__":
    main()
