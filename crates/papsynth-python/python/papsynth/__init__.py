"""The synthetic bright-field microscope for cytology, on NumPy arrays.

>>> import papsynth
>>> frame = papsynth.render({"field": {"width_px": 320, "height_px": 240}}, seed=7)
>>> frame.image.shape, frame.labels["nucleus"].dtype
((240, 320), dtype('int32'))

The same recipe, model, seed and index give the same bytes as the command line, with any number of threads.
"""

from __future__ import annotations

from . import cloth, cytoskeleton, dyes, fields, fsd, noise, optics, texture
from ._calibrate import calibrate_camera, calibrate_microscope
from ._dataset import Dataset, IterableDataset
from ._display import RecipeDict as _RecipeDict
from ._errors import FieldError, RecipeError
from ._learn import judge, learn, match
from ._native import IGNORED, MIMICS, MIN_DETECTABILITY, SEMANTIC_CLASSES, Engine, Frame
from ._native import presets as _presets
from ._native import recipe_schema as _recipe_schema
from ._native import resolve as _resolve
from ._render import render
from ._sets import generate, merge, missing, verify
from ._target import detection_target, semantic_target

__all__ = [
    "IGNORED",
    "MIMICS",
    "MIN_DETECTABILITY",
    "SEMANTIC_CLASSES",
    "Dataset",
    "Engine",
    "FieldError",
    "Frame",
    "IterableDataset",
    "RecipeError",
    "calibrate_camera",
    "calibrate_microscope",
    "cloth",
    "cytoskeleton",
    "detection_target",
    "dyes",
    "fields",
    "fsd",
    "generate",
    "judge",
    "learn",
    "match",
    "merge",
    "missing",
    "noise",
    "optics",
    "presets",
    "recipe",
    "render",
    "schema",
    "semantic_target",
    "texture",
    "verify",
]


def recipe(recipe=None, *, widen: float = 1.0) -> dict:
    """Return a complete recipe, with the defaults of all omitted fields.

    Parameters
    ----------
    recipe : None, str, os.PathLike or dict
        None for the default, the name of a preset, the path of a TOML file, or a dictionary of sections.
    widen : float
        Factor, 1 to 5, by which the distributions of stain, focus, light, noise, texture, debris and crowding become
        wider, for training. 1 changes nothing; 1.5 adds half of the spread between real slides.

    Returns
    -------
    dict
        Sections with their fields, as in TOML. Jupyter shows the fields that differ from the closest preset.

    Raises
    ------
    RecipeError
        If a field is invalid.
    ValueError
        If `widen` is out of range.
    """
    from ._toml import loads

    return _RecipeDict(loads(_resolve(recipe, widen)))


def presets() -> dict[str, str]:
    """Return the names of the presets with their summaries; the first is the default."""
    return dict(_presets())


def schema() -> dict:
    """Return the JSON schema of recipes: every field with type, range, unit and meaning."""
    import json

    return json.loads(_recipe_schema())
