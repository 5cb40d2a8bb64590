"""Measuring a microscope and its camera."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import _native

__all__ = ["calibrate_camera", "calibrate_microscope"]


def calibrate_microscope(
    stack: Sequence[Any] | None = None,
    edge: Any = None,
    *,
    step_um: float | None = None,
    windows: Sequence[tuple[int, int, int, int]] | None = None,
    line: tuple[float, float, float, float] | None = None,
    pixel_um: float | None = None,
    na: float | None = None,
    wavelength_um: float | None = None,
    mount_index: float | None = None,
    immersion_index: float | None = None,
    threads: int = 0,
) -> dict[str, Any]:
    """Measures the blur of a microscope on a focus stack of nuclei, on a straight edge, or on both.

    Parameters
    ----------
    stack : sequence of array_like, optional
        Three planes or more, each (height, width), at equal distances and on both sides of focus. Gives the blur against
        the distance from focus and, with ``step_um`` and ``pixel_um``, the aperture of the condenser.
    edge : array_like, optional
        An image with a straight edge in focus, (height, width). Gives the blur in focus.
    step_um : float, optional
        Travel of the stage from plane to plane.
    windows : sequence of (left, top, width, height), optional
        Where nuclei lie in the stack, in pixels. By default they are found: dark, compact, sharp things.
    line : (x0, y0, x1, y1), optional
        A line across the edge or along it, in pixels. By default the sharpest straight edge is found.
    pixel_um : float, optional
        Size of a pixel in the object. Without it there are no sections of a recipe.
    na, wavelength_um, mount_index, immersion_index : float, optional
        What is known of the microscope; by default 0.95, 0.57 µm, 1.515 and 1, a dry lens.
    threads : int
        0 for as many as there are processors.

    Returns
    -------
    dict
        ``microscope``, ``focus`` and ``edge``, as `papsynth calibrate` writes them to ``calibration.json``; in ``recipe``
        the sections of a bright-field microscope, in ``recipe_gaussian`` those of the paper's Gaussians, or None.

    Raises
    ------
    ValueError
        If the images cannot be measured; names which, and why.

    Examples
    --------
    >>> found = papsynth.calibrate_microscope(planes, step_um=0.5, pixel_um=0.25)  # doctest: +SKIP
    >>> papsynth.render(found["recipe"])  # doctest: +SKIP
    """
    return json.loads(
        _native.calibrate_microscope(
            None if stack is None else list(stack),
            edge,
            step_um=step_um,
            windows=None if windows is None else [tuple(window) for window in windows],
            line=None if line is None else tuple(line),
            pixel_um=pixel_um,
            na=na,
            wavelength_um=wavelength_um,
            mount_index=mount_index,
            immersion_index=immersion_index,
            threads=threads,
        )
    )


def calibrate_camera(
    flats: Sequence[Sequence[Any]], darks: Sequence[Any], *, bits: int | None = None
) -> dict[str, Any]:
    """Measures the gain, the noise and the non-uniformity of a camera by photon transfer (EMVA 1288).

    Parameters
    ----------
    flats : sequence of sequence of array_like
        For each level of light two frames or more of an even field, each (height, width), from near dark to the brightest.
    darks : sequence of array_like
        Two frames or more in the dark.
    bits : int, optional
        Bits of the camera's converter, 8 to 16; by default 8 for frames of uint8.

    Returns
    -------
    dict
        ``camera``, as `papsynth calibrate` writes it to ``calibration.json``, and in ``recipe`` the section of a recipe.

    Raises
    ------
    ValueError
        If the frames cannot be measured; names which, and why.
    """
    darks, flats = list(darks), [list(level) for level in flats]
    if bits is None:
        if any(np.asarray(frame).dtype != np.uint8 for frame in darks):
            raise ValueError("bits: only frames of uint8 tell the bits of the camera; expected 8 to 16")
        bits = 8
    return json.loads(_native.calibrate_camera(flats, darks, bits))
