"""Compares two nucleus segmenters on the same fields of several presets.

Needs numpy and scipy. Prints the F1 score of the nuclei.
"""

import numpy as np
import papsynth
from segmenters import by_contrast, by_threshold, f1, score, truth_of

FIELDS = 3
PRESETS = ["sparse", "lbc", "high-grade", "inflamed"]
SEGMENTERS = {"threshold": by_threshold, "contrast": by_contrast}


def main():
    table = {}
    print(f"{'preset':12}" + "".join(f"{name:>12}" for name in SEGMENTERS))
    for preset in PRESETS:
        recipe = papsynth.recipe(preset)
        recipe["field"] |= {"width_px": 640, "height_px": 480}
        counts = {name: np.zeros(3, dtype=int) for name in SEGMENTERS}
        for index in range(FIELDS):
            frame = papsynth.render(recipe, seed=5, index=index)
            for name, segment in SEGMENTERS.items():
                counts[name] += score(segment(frame.image, frame.pixel_um), truth_of(frame))
        for name in SEGMENTERS:
            table[preset, name] = f1(counts[name])
        print(f"{preset:12}" + "".join(f"{table[preset, name]:12.2f}" for name in SEGMENTERS), flush=True)
    return table


if __name__ == "__main__":
    main()
