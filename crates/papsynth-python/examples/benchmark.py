"""Which of two segmenters is better, and on what? Both on the same fields of several kinds of smears.

Needs numpy and scipy. Prints F1 of the nuclei that are found.
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
        for mix in recipe["cells"].values():
            mix["count"] = scaled(mix["count"], 640 * 480 / (1376 * 1038))
        counts = {name: np.zeros(3, dtype=int) for name in SEGMENTERS}
        for index in range(FIELDS):
            frame = papsynth.render(recipe, seed=5, index=index)
            for name, segment in SEGMENTERS.items():
                counts[name] += score(segment(frame.image, frame.pixel_um), truth_of(frame))
        for name in SEGMENTERS:
            table[preset, name] = f1(counts[name])
        print(f"{preset:12}" + "".join(f"{table[preset, name]:12.2f}" for name in SEGMENTERS), flush=True)
    return table


def scaled(count, share):
    """As many in a smaller field as lie on as much of a larger one."""
    if isinstance(count, dict):
        return {kind: [share * bound for bound in bounds] for kind, bounds in count.items()}
    return share * count


if __name__ == "__main__":
    main()
