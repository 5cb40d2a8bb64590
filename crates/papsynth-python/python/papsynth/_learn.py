"""Learning from real material, and judging against it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import _native

__all__ = ["judge", "learn"]


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
    """Learns a class of cells from images of nuclei and from outlines.

    Parameters
    ----------
    name : str
        Of the class: one of the model's, which is learned anew, or another.
    pixel_um : float
        Size of a pixel of all the material, 0.05 to 4.
    nuclei : sequence of (array_like, array_like), optional
        Images of transmitted light with their masks, each (height, width).
    nucleus_outlines, cytoplasm_outlines : sequence of array_like, optional
        Each (points, 2), pixels. Without outlines of nuclei those of the masks are taken.
    like : str, optional
        Class that it takes after in everything the material does not show; by default the one of its name.
    bethesda, source : str
        Category of the Bethesda system, and where the material came from.
    numbers_only : bool
        Whether the model holds no textures, so that nothing of a real cell can be seen in it.
    model : None, dict, str or os.PathLike
        What the class is added to; by default the model that ships.

    Returns
    -------
    dict
        The model, for ``papsynth.render(..., model=...)``, or for a file by `json.dump`.

    Raises
    ------
    ValueError
        If the material is too little or cannot be used; names which.
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
    threads: int = 0,
) -> dict[str, Any]:
    """Tells synthetic fields from real ones, and says by what.

    Parameters
    ----------
    real, synthetic : sequence of array_like
        Fields in grey, each (height, width), of one size of pixels; at least two of each.
    pixel_um : float
    full_scale : float, optional
        The grey level of a saturated pixel; by default that of the type, 255 for uint8.
    real_nuclei, synthetic_nuclei : sequence of array_like, optional
        Middles of the nuclei of each field, (n, 2): x and y in pixels. Without them nuclei are searched for.
    seed : int
    quick : bool
        Whether a first look is enough, five times as quick.
    threads : int
        0 for as many as there are processors. The numbers are the same.

    Returns
    -------
    dict
        What `papsynth judge` writes as ``report.json``.
    """
    if full_scale is None:
        kind = np.asarray(real[0]).dtype if len(real) else np.dtype(float)
        full_scale = float(np.iinfo(kind).max) if np.issubdtype(kind, np.integer) else 1.0

    def listed(values):
        return None if values is None else list(values)

    return json.loads(
        _native.judge(
            list(real),
            list(synthetic),
            pixel_um,
            full_scale,
            real_nuclei=listed(real_nuclei),
            synthetic_nuclei=listed(synthetic_nuclei),
            seed=seed,
            quick=quick,
            threads=threads,
        )
    )
