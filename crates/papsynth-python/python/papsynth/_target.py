"""Training targets for torchvision."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

__all__ = ["detection_target"]


def detection_target(frame: Any, part: str = "nucleus", classes: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Return the ground truth of a frame as a target of torchvision's detectors, in NumPy arrays.

    Parameters
    ----------
    frame : Frame
    part : str
        "nucleus", "cytoplasm" or "whole" (debris): the part to detect.
    classes : sequence of str, optional
        Class names. A label is the position in this list, from 1; objects of other classes are omitted. By default all
        labels are 1.

    Returns
    -------
    dict
        ``boxes`` (n, 4) float32: x0, y0, x1, y1; ``labels`` (n,) int64; ``masks`` (n, height, width) uint8, complete; ``area`` (n,)
        float32, pixels; ``iscrowd`` (n,) int64; ``image_id`` (1,) int64.

    Raises
    ------
    ValueError
        If the part or the list of classes is invalid.
    """
    parts = ("nucleus", "cytoplasm", "whole")
    if part not in parts:
        raise ValueError(f"part: {part!r}; expected one of {', '.join(parts)}")
    if isinstance(classes, str) or (classes is not None and len(set(classes)) < len(list(classes))):
        raise ValueError(f"classes: {classes!r}; expected a list of unique names")
    table = frame.table
    chosen = (table["part"] == part) & (table["area_px"] > 0)
    labels = np.ones(len(chosen), dtype=np.int64)
    if classes is not None:
        number = {name: place for place, name in enumerate(classes, 1)}
        labels = np.array([number.get(name, 0) for name in table["class"]], dtype=np.int64)
        chosen &= labels > 0
    return {
        "boxes": frame.boxes[chosen].astype(np.float32),
        "labels": labels[chosen],
        "masks": frame.masks[chosen].astype(np.uint8),
        "area": table["area_px"][chosen].astype(np.float32),
        "iscrowd": np.zeros(int(chosen.sum()), dtype=np.int64),
        "image_id": np.array([frame.index], dtype=np.uint64).astype(np.int64),
    }
