"""Prints the table of `cargo xtask worth`: F1 of nuclei by grade and Dice of a mask, for each training set.

    worth_table.py FOLDER

FOLDER has a file ARM-HALF-SEED.json of nucleus_net.py for each training. F1 counts the nuclei of all fields of a grade,
of both halves and all seeds. Intervals of 95 % are bootstraps over fields.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

GRADES = {"N": "normal", "L": "low-grade lesion", "H": "high-grade lesion"}
DRAWS = 2000


def f1(counts):
    """Return F1 of the rows (matched, detected, nuclei)."""
    matched, detected, nuclei = np.asarray(counts, float).reshape(-1, 3).sum(0)
    return 2 * matched / max(detected + nuclei, 1)


def with_interval(fields):
    """Return F1 with its interval; `fields` has the counts of every seed of each field."""
    rng = np.random.default_rng(0)
    fields = [np.asarray(counts) for counts in fields]
    draws = [f1(np.concatenate([fields[i] for i in rng.integers(len(fields), size=len(fields))])) for _ in range(DRAWS)]
    low, high = np.quantile(draws, (0.025, 0.975))
    return f"{f1(np.concatenate(fields)):.3f} ({low:.3f} to {high:.3f})"


def main():
    arms = defaultdict(list)
    for file in sorted(Path(sys.argv[1]).glob("*.json")):
        arm, half, seed = file.stem.rsplit("-", 2)
        arms[arm].append(json.loads(file.read_text()))
    print("trained on | trainings | " + " | ".join(f"F1, {name}" for name in GRADES.values()) + " | Dice of the mask")
    print("---|" * (len(GRADES) + 2) + "---")
    for arm, results in arms.items():
        cells = []
        for grade in GRADES:
            fields = defaultdict(list)
            for result in results:
                for field in result["fields"]:
                    if field["grade"] == grade:
                        fields[field["frame"]].append([field[name] for name in ("matched", "detected", "nuclei")])
            cells.append(with_interval(list(fields.values())) if fields else "-")
        dice = [result["dice"] for result in results if "dice" in result]
        scales = next((result["scales"] for result in results if "dice" in result), [])
        means = [f"{mean:.3f} at {scale}" for mean, scale in zip(np.mean(dice, 0), scales)] if dice else ["-"]
        print(" | ".join([arm.replace("_", " "), str(len(results)), *cells, ", ".join(means)]))


if __name__ == "__main__":
    main()
