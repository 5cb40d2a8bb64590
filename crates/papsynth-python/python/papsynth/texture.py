"""Patch-based texture synthesis."""

from ._native import texture as _texture

quilt = _texture.quilt

__all__ = ["quilt"]
