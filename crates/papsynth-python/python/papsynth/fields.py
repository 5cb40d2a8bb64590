"""Random fields and Perlin noise."""

from ._native import fields as _fields

matern = _fields.matern
perlin = _fields.perlin

__all__ = ["matern", "perlin"]
