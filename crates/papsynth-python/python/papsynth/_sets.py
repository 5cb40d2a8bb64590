"""Data sets in files, the same as those of the command line."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

from . import _native
from ._render import engine

__all__ = ["generate", "merge", "missing", "verify"]


def place(out: str | os.PathLike[str]) -> str:
    """Return the absolute path of a folder; addresses of object stores stay as they are."""
    out = os.fspath(out)
    return out if "://" in out else os.path.abspath(out)


def _list(names: str | Sequence[str] | None) -> list[str] | None:
    return [names] if isinstance(names, str) else None if names is None else list(names)


_OPTIONS = ("formats", "frames_per_shard", "without", "scenes", "threads", "verify", "min_detectability", "model")


def shard_count(recipe: Any, frames: int, options: dict[str, Any]) -> int:
    """Return the number of shards. Raises errors of recipe and options before a cluster starts."""
    if unknown := set(options) - set(_OPTIONS):
        accepted = f"{', '.join(_OPTIONS[:-1])} or {_OPTIONS[-1]}"
        raise TypeError(f"{', '.join(sorted(unknown))}: unknown option; expected {accepted}")
    engine(recipe, options.get("model"))
    formats, without = _list(options.get("formats")), _list(options.get("without"))
    return _native.shards(frames, formats, options.get("frames_per_shard"), without)


def task_count(shards: int, frames: int, workers: int, tasks: int | None) -> int:
    """Return the number of tasks of a cluster run.

    Default: one per shard, but at least 64 frames per task where that leaves four tasks per worker.
    """
    if tasks is not None and tasks < 1:
        raise ValueError(f"tasks: {tasks} is out of range: expected 1 or more")
    return min(shards, max(4 * workers, frames // 64, 1) if tasks is None else tasks)


class ProgressReporter:
    """Reports the number of complete shards, from their commit records."""

    def __init__(self, out: str, frames: int, shards: int, progress: Callable[[int, int], object] | None):
        self._out, self._frames, self._shards, self._progress = out, frames, shards, progress
        self._last, self._next = -1, time.monotonic()

    def update(self) -> None:
        if self._progress is None or time.monotonic() < self._next:
            return
        started = time.monotonic()
        try:
            complete = self._shards - len(missing(self._out, self._frames))
        except (ValueError, OSError):
            # The data set does not exist before the first task; other errors are raised by the tasks.
            complete = 0
        self._report(complete)
        # Reading the records takes at most a twentieth of the time.
        ended = time.monotonic()
        self._next = ended + max(1.0, 20 * (ended - started))

    def finish(self) -> None:
        self._report(self._shards)

    def _report(self, complete: int) -> None:
        if self._progress is not None and complete != self._last:
            self._last = complete
            self._progress(complete, self._shards)


def generate(
    recipe: Any,
    out: str | os.PathLike[str],
    frames: int,
    seed: int = 0,
    *,
    task: tuple[int, int] = (0, 1),
    formats: str | Sequence[str] | None = None,
    frames_per_shard: int | None = None,
    without: str | Sequence[str] | None = None,
    scenes: bool = False,
    threads: int = 1,
    verify: bool = False,
    model: Any = None,
    progress: Callable[[int], object] | None = None,
    min_detectability: float = _native.MIN_DETECTABILITY,
) -> dict[str, int]:
    """Generate the missing frames of a data set, or those of one task.

    A repeated call continues an interrupted one. Several processes may write the same folder. `merge` completes the
    data set.

    Parameters
    ----------
    recipe : None, str, os.PathLike or dict
        As for `papsynth.render`.
    out : str or os.PathLike
        A folder or an object store (``s3://bucket/prefix``, ``gs://``, ``az://``, with keys in the environment): new,
        empty, or a data set of the same recipe, seed and formats.
    frames : int
        Total number of frames, of all tasks.
    seed : int
        Seed of the data set.
    task : tuple of int
        (i, n), as for `--task i/n`: every n-th shard, starting with the i-th, i from 0 to n - 1.
    formats : str or list of str
        For example ``"webdataset"``. Default: ``"folder"``.
    frames_per_shard : int, optional
        Number of frames per shard.
    without : str or list of str, optional
        Files to leave out, as for `--without`: ``"noise-free"``, ``"layers"``, ``"labels"``, ``"semantic"``,
        ``"preview"``, ``"contact-sheet"``.
    scenes : bool
        Also write the scene of each frame to ``scenes/NNNNNN.json``, which `papsynth.render` reads.
    threads : int
        Number of frames rendered in parallel.
    verify : bool
        Check the hashes of existing files, not only their sizes.
    model : None, dict, str or os.PathLike
        As for `papsynth.render`.
    progress : callable, optional
        Called with the index of each finished frame.
    min_detectability : float
        Least detectability of nuclei and mimics that are not ignored, as for `papsynth.semantic_target`. Ignored
        objects have ``iscrowd`` 1 in COCO and 255 in ``labels/semantic``.

    Returns
    -------
    dict
        Numbers of frames ``"written"`` and already ``"present"``.

    Raises
    ------
    RecipeError
        If a field of the recipe is invalid.
    OSError
        If a file cannot be written. Written files are complete, and the same call continues.
    ValueError
        If an option is invalid, or the folder contains something else.
    """
    return _native.generate(
        engine(recipe, model),
        os.fspath(out),
        frames,
        seed,
        task=tuple(task),
        formats=_list(formats),
        frames_per_shard=frames_per_shard,
        without=_list(without),
        scenes=scenes,
        threads=threads,
        verify=verify,
        progress=progress,
        min_detectability=min_detectability,
    )


def merge(out: str | os.PathLike[str], frames: int) -> str:
    """Complete a data set: write the files about all frames.

    Returns
    -------
    str
        The root hash. Equal root hashes mean equal data sets.

    Raises
    ------
    ValueError
        If shards are missing (the message lists them), or there is no data set.
    OSError
        If a file cannot be read or written.
    """
    return _native.merge(os.fspath(out), frames)


def missing(out: str | os.PathLike[str], frames: int) -> list[int]:
    """Return the numbers of the missing shards, from commit records; also while other processes write."""
    return _native.missing(os.fspath(out), frames)


def verify(out: str | os.PathLike[str], frames: int | None = None) -> dict[str, Any]:
    """Check every file of a data set.

    Returns
    -------
    dict
        ``"root"``, the root hash of a complete data set, else None; the numbers of ``"frames"`` and ``"files"``;
        ``"findings"``, a list of (file, message).
    """
    return _native.verify(os.fspath(out), frames)
