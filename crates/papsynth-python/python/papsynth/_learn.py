"""Learning classes from real images, matching recipes to real fields, and comparing synthetic with real fields."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import _native
from ._toml import loads

__all__ = ["judge", "learn", "match"]


def learn(
    name: str,
    pixel_um: float,
    *,
    nuclei: Sequence[tuple[Any, Any]] | None = None,
    nucleus_outlines: Sequence[Any] | None = None,
    cytoplasm_outlines: Sequence[Any] | None = None,
    like: str | None = None,
    bethesda: str = "",
    source: str = "",
    numbers_only: bool = False,
    model: Any = None,
) -> dict[str, Any]:
    """Learn a class of cells from images of nuclei and from outlines.

    Parameters
    ----------
    name : str
        Name of the class. A class of the model with this name is replaced.
    pixel_um : float
        Pixel size of all images and outlines, 0.05 to 4 µm.
    nuclei : sequence of (array_like, array_like), optional
        Bright-field images with their masks, each (height, width).
    nucleus_outlines, cytoplasm_outlines : sequence of array_like, optional
        Outlines, each (points, 2), pixels. By default the nuclear outlines are those of the masks.
    like : str, optional
        Class that supplies all other properties. Default: the class of the same name.
    bethesda, source : str
        Bethesda category, and origin of the images.
    numbers_only : bool
        Store statistics only, no textures of real cells.
    model : None, dict, str or os.PathLike
        Model to extend. Default: the built-in model.

    Returns
    -------
    dict
        The model, for ``papsynth.render(..., model=...)`` or `json.dump`.

    Raises
    ------
    ValueError
        If there are too few images or outlines, or one cannot be used; the message names it.
    """

    def listed(values):
        return None if values is None else list(values)

    return json.loads(
        _native.learn(
            name,
            pixel_um,
            nuclei=None if nuclei is None else [tuple(pair) for pair in nuclei],
            nucleus_outlines=listed(nucleus_outlines),
            cytoplasm_outlines=listed(cytoplasm_outlines),
            like=like,
            bethesda=bethesda,
            source=source,
            numbers_only=numbers_only,
            model=model,
        )
    )


def judge(
    real: Sequence[Any],
    synthetic: Sequence[Any],
    pixel_um: float,
    *,
    full_scale: float | None = None,
    real_nuclei: Sequence[Any] | None = None,
    synthetic_nuclei: Sequence[Any] | None = None,
    seed: int = 0,
    quick: bool = False,
    features: str = "2",
    threads: int = 0,
) -> dict[str, Any]:
    """Compare synthetic with real fields.

    Parameters
    ----------
    real, synthetic : sequence of array_like
        Fields of the same pixel size, each (height, width), or (height, width, 3) in colour; at least two of each.
        Of colour images the green channel is compared.
    pixel_um : float
        Pixel size, µm.
    full_scale : float, optional
        Grey level of a saturated pixel. Default: the maximum of the integer type, 1 for floats.
    real_nuclei, synthetic_nuclei : sequence of array_like, optional
        Centres of the nuclei of each field, (n, 2): x and y in pixels. By default nuclei are detected.
    seed : int
        Seed of the classifier.
    quick : bool
        Five times as fast, with fewer trees and repetitions.
    features : {'1', '2'}
        Set of features: '1', of version 0.1, for comparison with older reports; '2', also the texture of cytoplasm.
    threads : int
        Number of threads; 0 for all processors. The result does not depend on it.

    Returns
    -------
    dict
        The content of ``report.json`` of `papsynth judge`.
    """
    real = list(real)

    def listed(values):
        return None if values is None else list(values)

    return json.loads(
        _native.judge(
            real,
            list(synthetic),
            pixel_um,
            _full_scale(real) if full_scale is None else full_scale,
            real_nuclei=listed(real_nuclei),
            synthetic_nuclei=listed(synthetic_nuclei),
            seed=seed,
            quick=quick,
            features=features,
            threads=threads,
        )
    )


def match(
    real: Sequence[Any],
    pixel_um: float,
    *,
    recipe: Any = None,
    full_scale: float | None = None,
    nuclei: Sequence[Any] | None = None,
    find_pixel: bool = False,
    simulations: int | None = None,
    refine: int = 0,
    quick: bool = False,
    seed: int = 0,
    model: Any = None,
    threads: int = 0,
) -> dict[str, Any]:
    """Find the recipe whose fields resemble real ones.

    Parameters
    ----------
    real : sequence of array_like
        Fields of one size and magnification, each (height, width), or (height, width, 3) in colour; at least two.
    pixel_um : float
        Pixel size, µm.
    recipe : None, dict, str or os.PathLike
        Initial recipe: as in `papsynth.render`. What the fields hardly show stays as it is there.
    full_scale : float, optional
        Grey level of a saturated pixel. Default: the maximum of the integer type, 1 for floats.
    nuclei : sequence of array_like, optional
        Centres of all nuclei of each field, (n, 2): x and y in pixels. By default nuclei are detected.
    find_pixel : bool
        Also estimate the pixel size, beginning with `pixel_um`, from the cell size of the initial recipe.
    simulations : int, optional
        Number of simulated fields with random parameters. Default: 150.
    refine : int
        Rounds of a search for parameters with which classifiers distinguish simulated from real fields less often.
    quick : bool
        Simulate fewer fields, for a first impression.
    seed : int
        Seed of the random numbers.
    model : None, dict, str or os.PathLike
        Model in addition to the built-in one: of `papsynth.learn`, or a class file.
    threads : int
        Number of threads; 0 for all processors. The result does not depend on it.

    Returns
    -------
    dict
        ``recipe``: the recipe, for `papsynth.render` and `papsynth.generate`. ``toml``: the same as text, with the
        estimates as comments. ``parameters``, ``statistics``, ``distance``, …: the content of the report of
        `papsynth match`.

    Raises
    ------
    ValueError
        If a field cannot be used, or shows too few nuclei; the message names it.
    """
    real = list(real)
    text, plain, report = _native.match_fields(
        real,
        pixel_um,
        _full_scale(real) if full_scale is None else full_scale,
        recipe=recipe,
        nuclei=None if nuclei is None else list(nuclei),
        find_pixel=find_pixel,
        simulations=simulations,
        refine=refine,
        quick=quick,
        seed=seed,
        model=model,
        threads=threads,
    )
    return {**json.loads(report), "recipe": loads(plain), "toml": text}


def _full_scale(fields: list[Any]) -> float:
    kind = np.asarray(fields[0]).dtype if fields else np.dtype(float)
    return float(np.iinfo(kind).max) if np.issubdtype(kind, np.integer) else 1.0
