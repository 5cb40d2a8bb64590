"""The synthetic bright-field microscope for cytology, on NumPy arrays.

>>> import papsynth
>>> frame = papsynth.render({"field": {"width_px": 320, "height_px": 240}}, seed=7)
>>> frame.image.shape, frame.labels["nucleus"].dtype
((240, 320), dtype('int32'))

The same recipe, model, seed and index give the same bytes as the command line, whatever the threads.
"""

from __future__ import annotations


from . import cloth, cytoskeleton, dyes, fields, fsd, noise, optics, texture
from ._calibrate import calibrate_camera, calibrate_microscope
from ._dataset import Dataset, IterableDataset
from ._errors import Fault, RecipeError
from ._learn import judge, learn
from ._native import Engine, Frame
from ._native import recipe_schema as _recipe_schema
from ._native import resolve as _resolve
from ._render import render
from ._sets import generate, merge, missing, verify
from ._target import detection_target

__all__ = [
    "Dataset",
    "Engine",
    "Fault",
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
    "merge",
    "missing",
    "noise",
    "optics",
    "recipe",
    "render",
    "schema",
    "texture",
    "verify",
]


def recipe(recipe=None) -> dict:
    """A recipe with everything that was left out.

    Parameters
    ----------
    recipe : None, str, os.PathLike or dict
        Nothing for the default, the name of a preset, the path of a TOML file, or fields by section.

    Returns
    -------
    dict
        Fields by section, as TOML has them.

    Raises
    ------
    RecipeError
        If a field cannot be what it is.
    """
    from ._toml import loads

    return loads(_resolve(recipe))


def schema() -> dict:
    """The JSON schema of recipes: every field with its type, range, unit and meaning."""
    import json

    return json.loads(_recipe_schema())
