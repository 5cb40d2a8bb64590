"""Cloth simulation of cytoplasm."""

from ._native import cloth as _cloth

crumple = _cloth.crumple

__all__ = ["crumple"]
