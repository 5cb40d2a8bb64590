"""Rendering of single images."""

from __future__ import annotations

import json
import os
from collections import OrderedDict
from threading import Lock

from . import _native

# Cache of recently used engines: creating one takes longer than rendering a small image.
_CACHE_SIZE = 4
_engines: OrderedDict[object, _native.Engine] = OrderedDict()
_lock = Lock()


def _after_fork() -> None:
    """Replace the lock, which another thread of the parent may have held during the fork."""
    global _lock
    _lock = Lock()
    _native._after_fork()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def _key(recipe, model):
    """Return the cache key of an engine, or None if it cannot be cached."""

    def of_file(path):
        path = os.path.abspath(os.fspath(path))
        found = os.stat(path)
        return path, found.st_mtime_ns, found.st_size

    try:
        if isinstance(model, dict):
            model = json.dumps(model, sort_keys=True)
        elif model is not None:
            model = of_file(model)
        if recipe is None:
            return None, model
        if hasattr(recipe, "to_dict"):
            recipe = recipe.to_dict()
        if isinstance(recipe, dict):
            return json.dumps(recipe, sort_keys=True), model
        if isinstance(recipe, str) and not os.path.exists(recipe):
            return ("preset", recipe), model
        return of_file(recipe), model
    except (TypeError, ValueError, OSError, RecursionError):
        return None


def engine(recipe=None, model=None) -> _native.Engine:
    """Return the engine of a recipe, cached if possible."""
    key = _key(recipe, model)
    if key is None:
        return _native.Engine(recipe, model)
    with _lock:
        if key in _engines:
            _engines.move_to_end(key)
            return _engines[key]
    new = _native.Engine(recipe, model)
    if new.names_files:
        # The files may change.
        return new
    with _lock:
        _engines[key] = new
        while len(_engines) > _CACHE_SIZE:
            _engines.popitem(last=False)
    return new


def render(recipe=None, seed: int = 0, index: int = 0, *, model=None, threads: int = 1, scene=None) -> _native.Frame:
    """Render an image or focus stack with its ground truth.

    Parameters
    ----------
    recipe : None, str, os.PathLike or dict
        None for the default, the name of a preset, the path of a TOML file, or a dictionary of sections. Omitted fields
        have their defaults.
    seed : int
        Seed of the data set, 0 to 2**64 - 1.
    index : int
        Index of the image, 0 to 2**64 - 1.
    model : None, dict, str or os.PathLike
        A model, such as `papsynth.learn` returns, or the path of a model or class file; extends the built-in model.
    threads : int
        Number of threads; 0 for all processors. The result does not depend on it.
    scene : None, dict, str or os.PathLike
        Scene to render instead of the one of seed and index: a dictionary such as `Engine.scene` returns, or the path
        of a JSON file that ``papsynth generate --scenes`` wrote.

    Returns
    -------
    Frame
        With ``image``, ``stack``, ``labels``, ``masks``, ``table``, ``noise_free`` and more.

    Raises
    ------
    RecipeError
        If a field of the recipe is invalid; ``field`` names it.
    OSError
        If a file cannot be read.
    MemoryError
        If a frame may need more memory than is available.
    ValueError
        If the scene or the model is invalid.
    OverflowError, TypeError
        If seed or index is not an integer in its range.
    """
    return engine(recipe, model).render(seed, index, threads=threads, scene=scene)
