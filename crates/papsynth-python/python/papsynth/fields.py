"""Random fields, and noise of backgrounds."""

from ._native import fields as _fields

matern = _fields.matern
perlin = _fields.perlin

__all__ = ["matern", "perlin"]
