"""Cytoskeletons on Voronoi diagrams."""

from ._native import cytoskeleton as _cytoskeleton

grow = _cytoskeleton.grow

__all__ = ["grow"]
