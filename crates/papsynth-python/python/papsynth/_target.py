"""Training targets: semantic label images, and targets of torchvision's detectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ._native import IGNORED, MIN_DETECTABILITY, SEMANTIC_CLASSES

__all__ = ["detection_target", "semantic_target"]


def _numbers(classes: Sequence[str | Sequence[str]]) -> dict[str, int]:
    """Return the label of each class name: the position of the name, or of the group that has it, from 1."""
    groups = None if isinstance(classes, str) else [(one,) if isinstance(one, str) else tuple(one) for one in classes]
    names = [name for group in groups or () for name in group]
    if groups is None or not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        raise ValueError(f"classes: {classes!r}; expected a list of unique names or of groups of unique names")
    if len(groups) >= IGNORED:
        raise ValueError(f"classes: {len(groups)} labels; expected at most {IGNORED - 1}")
    return {name: label for label, group in enumerate(groups, 1) for name in group}


def semantic_target(
    frame: Any,
    classes: Sequence[str | Sequence[str]] | None = None,
    *,
    min_detectability: float = MIN_DETECTABILITY,
) -> np.ndarray:
    """Return the class of each pixel of a frame, for semantic segmentation.

    Leukocytes, bare nuclei and shreds look like nuclei: `papsynth.MIMICS` lists their classes. The target for nuclei
    (1) against mimics (2) is ``semantic_target(frame, ["nucleus", papsynth.MIMICS])``.

    Parameters
    ----------
    frame : Frame
    classes : sequence, optional
        Names from `papsynth.SEMANTIC_CLASSES`, or groups of names. A label is the position in this list, from 1; other
        objects are omitted. By default a label is the position in `papsynth.SEMANTIC_CLASSES`.
    min_detectability : float
        Nuclei and mimics below this contrast-to-noise ratio in each plane are ignored; 0 ignores none.

    Returns
    -------
    ndarray
        (height, width), uint8: labels; 0 for background, 255 for ignored pixels. Of several classes at a pixel, the
        last one in `papsynth.SEMANTIC_CLASSES` counts. In PyTorch, use ``ignore_index=255``.

    Raises
    ------
    ValueError
        If a class is unknown or repeated, or `min_detectability` is negative or not finite.
    """
    if classes is None:
        return frame.semantic(min_detectability=min_detectability)
    labels = _numbers(classes)
    target = frame.semantic(list(labels), min_detectability=min_detectability)
    table = np.zeros(256, dtype=np.uint8)
    table[IGNORED] = IGNORED
    for name, label in labels.items():
        table[SEMANTIC_CLASSES.index(name)] = label
    return table[target]


def detection_target(
    frame: Any,
    part: str | None = "nucleus",
    classes: Sequence[str | Sequence[str]] | None = None,
    *,
    by: str = "class",
    min_detectability: float = MIN_DETECTABILITY,
) -> dict[str, np.ndarray]:
    """Return the ground truth of a frame as a target of torchvision's detectors, in NumPy arrays.

    The target for nuclei (1) against objects that look like nuclei (2) is
    ``detection_target(frame, None, ["nucleus", papsynth.MIMICS], by="semantic_class")``.

    Parameters
    ----------
    frame : Frame
    part : str or None
        "nucleus", "cytoplasm" or "whole" (debris): the part to detect. None: all parts.
    classes : sequence, optional
        Class names, or groups of names. A label is the position in this list, from 1; objects of other classes are
        omitted. By default all labels are 1.
    by : str
        Column of ``frame.table`` with the class names: "class" or "semantic_class".
    min_detectability : float
        Nuclei and mimics below this contrast-to-noise ratio in each plane have ``iscrowd`` 1; 0 for none. Training code
        of torchvision and COCO evaluation leave them out.

    Returns
    -------
    dict
        ``boxes`` (n, 4) float32: x0, y0, x1, y1; ``labels`` (n,) int64; ``masks`` (n, height, width) uint8, complete;
        ``area`` (n,) float32, pixels; ``iscrowd`` (n,) int64; ``image_id`` (1,) int64.

    Raises
    ------
    ValueError
        If `part`, `classes`, `by` or `min_detectability` is invalid.
    """
    parts = ("nucleus", "cytoplasm", "whole")
    if part is not None and part not in parts:
        raise ValueError(f"part: {part!r}; expected None or one of {', '.join(parts)}")
    if by not in ("class", "semantic_class"):
        raise ValueError(f"by: {by!r}; expected 'class' or 'semantic_class'")
    table = frame.table
    chosen = table["area_px"] > 0
    if part is not None:
        chosen &= table["part"] == part
    labels = np.ones(len(chosen), dtype=np.int64)
    if classes is not None:
        number = _numbers(classes)
        if by == "semantic_class" and (unknown := sorted(set(number) - set(SEMANTIC_CLASSES))):
            raise ValueError(f"classes: unknown class {unknown[0]!r}; expected some of {', '.join(SEMANTIC_CLASSES)}")
        labels = np.array([number.get(name, 0) for name in table[by]], dtype=np.int64)
        chosen &= labels > 0
    return {
        "boxes": frame.boxes[chosen].astype(np.float32),
        "labels": labels[chosen],
        "masks": frame.masks[chosen].astype(np.uint8),
        "area": table["area_px"][chosen].astype(np.float32),
        "iscrowd": frame.ignored(min_detectability)[chosen].astype(np.int64),
        "image_id": np.array([frame.index], dtype=np.uint64).astype(np.int64),
    }
