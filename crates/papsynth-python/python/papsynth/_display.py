"""Frames and recipes in Jupyter."""

from __future__ import annotations

import html
import struct
import zlib
from functools import lru_cache
from typing import Any

import numpy as np

from . import _native
from ._schema import differences, notation
from ._toml import loads

__all__ = ["RecipeDict", "engine_html", "frame_png", "given_html", "recipe_html"]

# Largest side of a picture, pixels.
_SIDE_PX = 768

# Largest number of fields in a table.
_ROWS = 60

# Colours that are distinguishable with colour vision deficiency (Okabe and Ito). Nuclei are drawn over cells.
_OUTLINES = {"cytoplasm": (0, 158, 115), "nucleus": (213, 94, 0)}


def _inner_outline(labels: np.ndarray) -> np.ndarray:
    """Return the pixels of objects with a neighbour of another object or of the background: (height, width), bool."""
    edge = np.zeros(labels.shape, dtype=bool)
    across, along = labels[1:] != labels[:-1], labels[:, 1:] != labels[:, :-1]
    edge[1:] |= across
    edge[:-1] |= across
    edge[:, 1:] |= along
    edge[:, :-1] |= along
    return edge & (labels > 0)


def _blocks(values: np.ndarray, side: int) -> np.ndarray:
    """Return blocks of side × side pixels: (rows, side, columns, side[, channels]). The last repeat border pixels."""
    height, width = values.shape[:2]
    more = [(0, -height % side), (0, -width % side)] + [(0, 0)] * (values.ndim - 2)
    values = np.pad(values, more, mode="edge")
    return values.reshape(values.shape[0] // side, side, values.shape[1] // side, side, *values.shape[2:])


def _png(rgb: np.ndarray) -> bytes:
    """Return an image, (height, width, 3), uint8, as PNG. Each byte is stored as the difference from the left pixel."""
    height, width, _ = rgb.shape
    rows = rgb.copy()
    rows[:, 1:] -= rgb[:, :-1]
    rows = np.concatenate([np.ones((height, 1), dtype=np.uint8), rows.reshape(height, -1)], axis=1)

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    data = chunk(b"IDAT", zlib.compress(rows.tobytes(), 6))
    return b"\x89PNG\r\n\x1a\n" + header + data + chunk(b"IEND", b"")


def frame_png(frame: _native.Frame) -> bytes:
    """Return the image of a frame as PNG, at most 768 pixels a side, with outlines of the visible cells and nuclei."""
    image = frame.image
    side = max(-(-max(image.shape[:2]) // _SIDE_PX), 1)
    levels = _blocks(image, side).mean(axis=(1, 3)) * (255 / (2**frame.bits - 1))
    rgb = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    if rgb.ndim == 2:
        rgb = np.repeat(rgb[..., None], 3, axis=2)
    for group, colour in _OUTLINES.items():
        rgb[_blocks(_inner_outline(frame.labels[group]), side).any(axis=(1, 3))] = colour
    return _png(rgb)


@lru_cache(maxsize=1)
def _presets() -> dict[str, dict[str, Any]]:
    return {name: loads(_native.resolve(name)) for name, _ in _native.presets()}


def recipe_html(recipe: dict[str, Any], title: str = "Recipe") -> str:
    """Return a complete recipe as HTML: the preset with the fewest differences, and a table of the differences."""
    found = {name: differences(recipe, preset) for name, preset in _presets().items()}
    preset = min(found, key=lambda name: len(found[name]))
    rows, count = found[preset][:_ROWS], len(found[preset])
    changes = "without changes" if count == 0 else f"with {count} change{'s' if count > 1 else ''}"
    name, summary = html.escape(preset), html.escape(dict(_native.presets())[preset])
    text = f"<p><b>{html.escape(title)}</b>: the preset <code>{name}</code> ({summary}), {changes}.</p>"
    if not rows:
        return text
    left = ' style="text-align:left"'
    heads = "".join(f"<th{left}>{word}</th>" for word in ("Field", "Value", f"In {name}", "Meaning"))
    text += f"<table><thead><tr>{heads}</tr></thead><tbody>"
    for field, value, other, meaning in rows:
        codes = (html.escape(word) for word in (field, notation(value), notation(other)))
        cells = "".join(f"<td{left}><code>{code}</code></td>" for code in codes)
        text += f"<tr>{cells}<td{left}>{html.escape(meaning)}</td></tr>"
    text += "</tbody></table>"
    return text + (f"<p>{count - len(rows)} more fields differ.</p>" if count > len(rows) else "")


def engine_html(toml: str) -> str | None:
    """Return the complete recipe of an engine, in TOML, as HTML; None if this Python cannot read TOML."""
    try:
        return recipe_html(loads(toml), "Engine")
    except ModuleNotFoundError:
        return None


def given_html(recipe: dict[str, Any]) -> str | None:
    """Return a recipe as HTML, with the defaults of its omitted fields, or its errors.

    Returns None, for the plain form, if this Python cannot read TOML.
    """
    try:
        return recipe_html(loads(_native.resolve(recipe)))
    except ModuleNotFoundError:
        return None
    except (TypeError, ValueError) as error:
        return f"<p><b>Invalid recipe</b>: {html.escape(str(error))}</p>"


class RecipeDict(dict):
    """A complete recipe as a dictionary, which Jupyter shows as a table of its differences from a preset."""

    def _repr_html_(self) -> str | None:
        return given_html(self)
