"""Measures a classical segmenter while one parameter of the recipe varies.

Needs numpy and scipy. Prints the F1 score of the nuclei against defocus, debris and illumination.
"""

import numpy as np
import papsynth
from segmenters import by_contrast, f1, score, truth_of

FIELDS = 3
BASE = {"field": {"width_px": 640, "height_px": 480}}

STUDIES = {
    "focus.centre_um": [0.0, 4.0, 8.0, 12.0, 16.0],
    "debris.leukocytes.clusters": [0, 4, 12, 30],
    "background.level": [0.2, 0.5, 0.85],
}


def with_value(recipe, field, value):
    """Return a complete recipe with another value of a field."""
    *sections, name = field.split(".")
    whole = papsynth.recipe(recipe)
    inner = whole
    for section in sections:
        inner = inner[section]
    inner[name] = value
    return whole


def main():
    table = {}
    for field, values in STUDIES.items():
        for value in values:
            recipe = with_value(BASE, field, value)
            counts = np.zeros(3, dtype=int)
            for index in range(FIELDS):
                frame = papsynth.render(recipe, seed=11, index=index)
                counts += score(by_contrast(frame.image, frame.pixel_um), truth_of(frame))
            table[field, value] = f1(counts)
            found, wrong, missed = counts
            details = f"(found {found}, wrong {wrong}, missed {missed})"
            print(f"{field:28} {value:6}  F1 {f1(counts):.2f}  {details}", flush=True)
    return table


if __name__ == "__main__":
    main()
