"""What a camera makes of light."""

from ._native import camera as _camera

expose = _camera.expose

__all__ = ["expose"]
