"""Data sets on the disk, as the command line makes them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

from . import _native
from ._render import engine

__all__ = ["generate", "merge", "missing", "verify"]


def place(out: str | os.PathLike[str]) -> str:
    """A folder as every process finds it; the address of an object store as it is."""
    out = os.fspath(out)
    return out if "://" in out else os.path.abspath(out)


def _list(formats: str | Sequence[str] | None) -> list[str] | None:
    return [formats] if isinstance(formats, str) else None if formats is None else list(formats)


def written(recipe: Any, frames: int, options: dict[str, Any]) -> int:
    """Number of shards that are written. Whatever is wrong with the recipe or the options is raised here, before a cluster is begun."""
    if unknown := set(options) - {"formats", "frames_per_shard", "threads", "verify", "model"}:
        raise TypeError(f"{', '.join(sorted(unknown))}: not known; expected formats, frames_per_shard, threads, verify or model")
    engine(recipe, options.get("model"))
    return _native.shards(frames, _list(options.get("formats")), options.get("frames_per_shard"))


def tasks(written: int, frames: int, workers: int, shards: int | None) -> int:
    """Into how many tasks a cluster divides so many shards: one each, but tasks of 64 frames at least where there are more of them than
    four a worker, unless the number is said."""
    if shards is not None and shards < 1:
        raise ValueError(f"shards: {shards}; expected 1 or more")
    return min(written, max(4 * workers, frames // 64, 1) if shards is None else shards)


class Told:
    """Tells, now and then, how many shards are whole, by their commit records."""

    def __init__(self, out: str, frames: int, written: int, progress: Callable[[int, int], object] | None):
        self._out, self._frames, self._written, self._progress = out, frames, written, progress
        self._last, self._next = -1, time.monotonic()

    def now_and_then(self) -> None:
        if self._progress is None or time.monotonic() < self._next:
            return
        begun = time.monotonic()
        try:
            whole = self._written - len(missing(self._out, self._frames))
        except (ValueError, OSError):
            # Before the first task there is no data set. What else is wrong is said by whoever needs it.
            whole = 0
        self._tell(whole)
        # However many records there are, reading them takes no more than a twentieth of the time.
        ended = time.monotonic()
        self._next = ended + max(1.0, 20 * (ended - begun))

    def finish(self) -> None:
        self._tell(self._written)

    def _tell(self, whole: int) -> None:
        if self._progress is not None and whole != self._last:
            self._last = whole
            self._progress(whole, self._written)


def generate(
    recipe: Any,
    out: str | os.PathLike[str],
    frames: int,
    seed: int = 0,
    *,
    shard: tuple[int, int] = (0, 1),
    formats: str | Sequence[str] | None = None,
    frames_per_shard: int | None = None,
    scenes: bool = False,
    threads: int = 1,
    verify: bool = False,
    model: Any = None,
    progress: Callable[[int], object] | None = None,
) -> dict[str, int]:
    """Makes the frames of a data set that are not whole there, or a part of them.

    Killed and called again it goes on; several processes may work on the same folder. `merge` closes the data set.

    Parameters
    ----------
    recipe : None, str, os.PathLike or dict
        As of `papsynth.render`.
    out : str or os.PathLike
        New, empty, or a data set of the same recipe, seed and formats: a folder, or an object store (``s3://bucket/prefix``, ``gs://``,
        ``az://``) with keys in the environment.
    frames : int
        Frames that there will be in all, by all parts.
    seed : int
    shard : tuple of int
        (i, n), as of `--shard i/n`: every n-th shard from the i-th on; n processes with i from 0 to n - 1 make all.
    formats : str or list of str
        Such as ``"folder"`` (the default) or ``"webdataset"``.
    frames_per_shard : int, optional
        Frames that are written and made again together.
    scenes : bool
        Whether the scene of each frame is written too, as ``scenes/NNNNNN.json``, which `papsynth.render` reads.
    threads : int
        Frames that are made side by side.
    verify : bool
        Whether files that are there are read, rather than their sizes compared.
    model : None, dict, str or os.PathLike
        As of `papsynth.render`.
    progress : callable, optional
        Called with the index of each frame that is done.

    Returns
    -------
    dict
        Numbers of frames that were ``"kept"`` and ``"made"``.

    Raises
    ------
    RecipeError
        If a field of the recipe cannot be what it is.
    OSError
        If the system refuses to write; what is written is whole, and the same call goes on.
    ValueError
        If the folder holds something else.
    """
    made_by = engine(recipe, model)
    return _native.generate(
        made_by,
        os.fspath(out),
        frames,
        seed,
        shard=tuple(shard),
        formats=_list(formats),
        frames_per_shard=frames_per_shard,
        scenes=scenes,
        threads=threads,
        verify=verify,
        progress=progress,
    )


def merge(out: str | os.PathLike[str], frames: int) -> str:
    """Closes a data set: fails on any gap, writes the files about all frames.

    Returns
    -------
    str
        The root hash: two data sets of one root hash are the same.

    Raises
    ------
    ValueError
        If shards are missing, which are named, or there is no data set.
    OSError
        If the system refuses to read or write.
    """
    return _native.merge(os.fspath(out), frames)


def missing(out: str | os.PathLike[str], frames: int) -> list[int]:
    """Numbers of the shards that are not whole, from commit records: also while others work."""
    return _native.missing(os.fspath(out), frames)


def verify(out: str | os.PathLike[str], frames: int | None = None) -> dict[str, Any]:
    """Reads every file of a data set and says what is wrong.

    Returns
    -------
    dict
        ``"root"``, the root hash of a data set that is whole, else None; numbers of ``"frames"`` and ``"files"``; ``"findings"``, a list of
        (file, what is wrong with it).
    """
    return _native.verify(os.fspath(out), frames)
