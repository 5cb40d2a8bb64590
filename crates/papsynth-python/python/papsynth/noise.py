"""Noise of a camera: what it makes of light."""

from ._native import noise as _noise

expose = _noise.expose

__all__ = ["expose"]
