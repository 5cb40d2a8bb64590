"""Fourier shape descriptors of outlines."""

from ._native import fsd as _fsd

ShapeModel = _fsd.ShapeModel
trace = _fsd.trace

__all__ = ["ShapeModel", "trace"]
