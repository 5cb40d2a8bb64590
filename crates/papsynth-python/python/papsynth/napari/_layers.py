"""Layers of frames."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._native import Frame

__all__ = ["LayerData", "add", "layers"]

LayerData = tuple[np.ndarray, dict[str, Any], str]
"""Data, options and type of a layer, as plugins of napari return them."""

# Name of a labels layer, group of its label map, part in the table.
_LABELS = (("cells", "cytoplasm", "cytoplasm"), ("nuclei", "nucleus", "nucleus"))


def layers(frame: Frame, name: str | None = None, metadata: dict[str, Any] | None = None) -> list[LayerData]:
    """Return a frame as layers of napari: the image, and label maps of the visible cells and nuclei.

    Parameters
    ----------
    frame : Frame
    name : str, optional
        Start of the names of the layers. Default: seed and index of the frame.
    metadata : dict, optional
        Values that each layer keeps in ``metadata["papsynth"]``, in addition to seed and index.

    Returns
    -------
    list of (ndarray, dict, str)
        Data, options and type of each layer. "image": (height, width) or, for a focus stack, (planes, height, width);
        in colour with a last axis of 3. "labels", twice: (height, width), int32, with the rows of ``frame.table`` as
        ``features``; the column "index" is the label. Scales are in µm.
    """
    name = f"seed {frame.seed}, index {frame.index}" if name is None else name
    kept = {"papsynth": {"seed": frame.seed, "index": frame.index, **(metadata or {})}}
    plane: dict[str, Any] = {"scale": (frame.pixel_um,) * 2, "units": ("um",) * 2, "axis_labels": ("y", "x")}
    image = dict(plane)
    planes = frame.planes_um
    if len(frame.stack) > 1:
        image = {
            "scale": ((planes[-1] - planes[0]) / (len(planes) - 1), *plane["scale"]),
            "translate": (planes[0], 0.0, 0.0),
            "units": ("um",) * 3,
            "axis_labels": ("focus", "y", "x"),
        }
    stack: np.ndarray = frame.stack
    options = {
        **image,
        "name": f"{name}: image",
        "rgb": frame.image.ndim == 3,
        "contrast_limits": (0, 2**frame.bits - 1),
        "metadata": kept,
    }
    if options["rgb"]:
        # napari shows colours of 8 bits, or fractions.
        del options["contrast_limits"]
        stack = stack if frame.bits == 8 else (stack / np.float32(2**frame.bits - 1)).astype(np.float32)
    found: list[LayerData] = [(stack if len(stack) > 1 else stack[0], options, "image")]
    for title, group, part in _LABELS:
        chosen = frame.table["part"] == part
        rows = {column: values[chosen] for column, values in frame.table.items() if column not in ("id", "image")}
        features = {"index": frame.table["id"][chosen].astype(np.int64), **rows}
        options = {**plane, "name": f"{name}: {title}", "features": features, "opacity": 0.4, "metadata": kept}
        found.append((frame.labels[group], options, "labels"))
    return found


def add(viewer: Any, frame: Frame, name: str | None = None, metadata: dict[str, Any] | None = None) -> list[Any]:
    """Add a frame to a viewer, with the middle plane of a focus stack in view.

    Parameters
    ----------
    viewer : napari.Viewer or napari.components.ViewerModel
    frame, name, metadata
        As for `layers`.

    Returns
    -------
    list of napari.layers.Layer
        The new layers: image, cells, nuclei.
    """
    return add_data(viewer, layers(frame, name, metadata))


def add_data(viewer: Any, data: list[LayerData]) -> list[Any]:
    """Add layer data to a viewer, with the middle plane of a stack in view, and return the layers."""
    from napari.layers import Layer

    new = [viewer.add_layer(Layer.create(*one)) for one in data]
    depth = new[0].ndim
    if depth > 2:
        middle = new[0].translate[0] + new[0].scale[0] * (len(new[0].data) // 2)
        viewer.dims.set_point(viewer.dims.ndim - depth, middle)
    return new
