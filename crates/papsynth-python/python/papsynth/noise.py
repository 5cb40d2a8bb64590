"""Camera model of EMVA 1288."""

from ._native import noise as _noise

expose = _noise.expose

__all__ = ["expose"]
