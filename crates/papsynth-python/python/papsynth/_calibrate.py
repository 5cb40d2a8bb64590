"""Calibration of a microscope and its camera."""

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
    """Measure the blur of a microscope from a focus stack of nuclei, a straight edge, or both.

    Parameters
    ----------
    stack : sequence of array_like, optional
        Three or more planes, each (height, width), equally spaced, on both sides of focus. Gives the blur as a function
        of defocus and, with ``step_um`` and ``pixel_um``, the aperture of the condenser.
    edge : array_like, optional
        An image with a straight edge in focus, (height, width). Gives the blur in focus.
    step_um : float, optional
        Distance between planes, µm.
    windows : sequence of (left, top, width, height), optional
        Boxes around nuclei, pixels. By default dark, compact, sharp objects are detected.
    line : (x0, y0, x1, y1), optional
        A line across the edge or along it, pixels. By default the sharpest straight edge is detected.
    pixel_um : float, optional
        Pixel size in the object plane, µm. Required for the sections of a recipe.
    na, wavelength_um, mount_index, immersion_index : float, optional
        Properties of the microscope. Default: 0.95, 0.57 µm, 1.515 and 1 (a dry objective).
    threads : int
        Number of threads; 0 for all processors.

    Returns
    -------
    dict
        ``microscope``, ``focus`` and ``edge``, as `papsynth calibrate` writes them to ``calibration.json``; ``recipe``
        with the sections of a bright-field microscope and ``recipe_gaussian`` with those of the paper's Gaussians, or
        None.

    Raises
    ------
    ValueError
        If an image cannot be measured; the message names the image and the reason.

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
    """Measure gain, noise and non-uniformity of a camera by photon transfer (EMVA 1288).

    Parameters
    ----------
    flats : sequence of sequence of array_like
        For each light level two or more frames of a uniform field, each (height, width), from nearly dark to
        saturation.
    darks : sequence of array_like
        Two or more dark frames.
    bits : int, optional
        Bits of the analogue-to-digital converter, 8 to 16. Default: 8 for frames of uint8.

    Returns
    -------
    dict
        ``camera``, as `papsynth calibrate` writes it to ``calibration.json``, and ``recipe`` with the section of a
        recipe.

    Raises
    ------
    ValueError
        If a frame cannot be measured; the message names the frame and the reason.
    """
    darks, flats = list(darks), [list(level) for level in flats]
    if bits is None:
        if any(np.asarray(frame).dtype != np.uint8 for frame in darks):
            raise ValueError("bits: required unless all frames are uint8; expected 8 to 16")
        bits = 8
    return json.loads(_native.calibrate_camera(flats, darks, bits))
