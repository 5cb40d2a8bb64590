"""One image at a time."""

from __future__ import annotations

import json
import os
from collections import OrderedDict
from threading import Lock

from . import _native

# Engines that were used last: making one takes longer than many an image.
_MOST = 4
_engines: OrderedDict[object, _native.Engine] = OrderedDict()
_lock = Lock()


def _after_fork() -> None:
    """What another thread of the parent held while it was forked is not held by anybody here."""
    global _lock
    _lock = Lock()
    _native._after_fork()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def _key(recipe, model):
    """What tells engines apart, or nothing if it cannot be said."""

    def of_file(path):
        path = os.path.abspath(os.fspath(path))
        found = os.stat(path)
        return path, found.st_mtime_ns, found.st_size

    try:
        model = None if model is None else json.dumps(model, sort_keys=True) if isinstance(model, dict) else of_file(model)
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
    """The engine of a recipe: the one of last time, if it is the same."""
    key = _key(recipe, model)
    if key is None:
        return _native.Engine(recipe, model)
    with _lock:
        if key in _engines:
            _engines.move_to_end(key)
            return _engines[key]
    made = _native.Engine(recipe, model)
    if made.names_files:
        # They may be others next time.
        return made
    with _lock:
        _engines[key] = made
        while len(_engines) > _MOST:
            _engines.popitem(last=False)
    return made


def render(recipe=None, seed: int = 0, index: int = 0, *, model=None, threads: int = 1, scene=None) -> _native.Frame:
    """Makes an image or focus stack, and its truth.

    Parameters
    ----------
    recipe : None, str, os.PathLike or dict
        Nothing for the default, the name of a preset, the path of a TOML file, or fields by section; what is left out is the default.
    seed : int
        The data set, 0 to 2**64 - 1.
    index : int
        The image in it, 0 to 2**64 - 1.
    model : None, dict, str or os.PathLike
        A model, such as `papsynth.learn` returns, or the path of a model or class file, laid over the model that ships.
    threads : int
        Threads that work on it; 0 for as many as there are processors. The bytes are the same.
    scene : None, dict, str or os.PathLike
        A scene to image in place of the one of seed and index: as `Engine.scene` returns it, perhaps changed, or the path of a
        JSON file that ``papsynth generate --scenes`` wrote.

    Returns
    -------
    Frame
        Its ``image``, ``stack``, ``labels``, ``masks``, ``table``, ``noise_free`` and more.

    Raises
    ------
    RecipeError
        If a field of the recipe cannot be what it is; ``field`` names it.
    OSError
        If a file cannot be read.
    MemoryError
        If a frame of the recipe may need more memory than there is, where the system tells.
    ValueError
        If the scene cannot be drawn or is not valid, or the model cannot be used.
    OverflowError, TypeError
        If seed or index are no whole numbers in their range.
    """
    return engine(recipe, model).render(seed, index, threads=threads, scene=scene)
