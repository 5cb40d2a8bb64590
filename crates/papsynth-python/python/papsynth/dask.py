"""Data sets made by a Dask cluster: a task a part of the shards."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

from . import _sets

__all__ = ["generate"]

_RETRIES = 20


def _part(recipe, out, frames, seed, shard, options):
    _sets.generate(recipe, out, frames, seed, shard=shard, **options)


def generate(
    recipe: Any,
    out: str | os.PathLike[str],
    frames: int,
    seed: int = 0,
    *,
    client: Any = None,
    shards: int | None = None,
    progress: Callable[[int, int], object] | None = None,
    **options: Any,
) -> str:
    """Makes a data set in a folder that all workers share, or in an object store whose keys they have, and closes it.

    Tasks are tried again when their worker dies or the system refuses to write; the same call goes on with what there is.

    Parameters
    ----------
    recipe, out, frames, seed
        As of `papsynth.generate`.
    client : dask.distributed.Client, optional
        By default the one of this process, or a cluster on this machine.
    shards : int, optional
        Into how many parts the work is divided, a task each, as n of `--shard i/n`; by default one for each shard that is written, but of
        64 frames at least where that leaves each thread four.
    progress : callable, optional
        Called with the number of shards that are written whole, and of all, from commit records: what was there before counts.
    **options
        As of `papsynth.generate`: formats, frames_per_shard, scenes, threads, verify, model.

    Returns
    -------
    str
        The root hash.
    """
    try:
        from dask.distributed import Client, get_client
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("papsynth.dask needs Dask: pip install 'papsynth[dask]'", name="dask") from error
    # What is wrong is said before a cluster is begun.
    written = _sets.written(recipe, frames, options)
    _sets.tasks(written, frames, 1, shards)
    own = None
    if client is None:
        try:
            client = get_client()
        except ValueError:
            client = own = Client()
    try:
        out = _sets.place(out)
        told = _sets.Told(out, frames, written, progress)
        parts = _sets.tasks(written, frames, max(1, sum(client.nthreads().values())), shards)
        # Names of their own: a task of another call is never taken for one of these.
        tasks = [
            client.submit(_part, recipe, out, frames, seed, (part, parts), options, retries=_RETRIES, pure=False)
            for part in range(parts)
        ]
        try:
            while progress is not None and not all(task.done() for task in tasks):
                told.now_and_then()
                time.sleep(0.2)
            client.gather(tasks)
        except BaseException:
            # One that cannot be made ends all: nobody waits for the others.
            client.cancel(tasks)
            raise
        told.finish()
    finally:
        if own is not None:
            own.close()
    return _sets.merge(out, frames)
