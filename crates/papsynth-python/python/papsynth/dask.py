"""Generation of data sets on a Dask cluster."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

from . import _sets

__all__ = ["generate"]

_RETRIES = 20


def _task(recipe, out, frames, seed, task, options):
    _sets.generate(recipe, out, frames, seed, task=task, **options)


def generate(
    recipe: Any,
    out: str | os.PathLike[str],
    frames: int,
    seed: int = 0,
    *,
    client: Any = None,
    tasks: int | None = None,
    progress: Callable[[int, int], object] | None = None,
    **options: Any,
) -> str:
    """Generate and complete a data set in a folder that all workers share, or in an object store whose keys they have.

    Tasks are retried if their worker dies or a file cannot be written. The same call continues an interrupted one.

    Parameters
    ----------
    recipe, out, frames, seed
        As for `papsynth.generate`.
    client : dask.distributed.Client, optional
        Default: the client of this process, or a local cluster.
    tasks : int, optional
        Number of tasks, as n of `--task i/n`. Default: one per shard, but at least 64 frames per task where that leaves
        four tasks per thread.
    progress : callable, optional
        Called with the number of complete shards and their total number, including shards of earlier calls.
    **options
        As for `papsynth.generate`: formats, frames_per_shard, without, scenes, threads, verify,
        min_detectability, model.

    Returns
    -------
    str
        The root hash.
    """
    try:
        from dask.distributed import Client, get_client
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("papsynth.dask needs Dask: pip install 'papsynth[dask]'", name="dask") from error
    # Raises errors before a cluster starts.
    shards = _sets.shard_count(recipe, frames, options)
    _sets.task_count(shards, frames, 1, tasks)
    own = None
    if client is None:
        try:
            client = get_client()
        except ValueError:
            client = own = Client()
    try:
        out = _sets.place(out)
        reporter = _sets.ProgressReporter(out, frames, shards, progress)
        tasks = _sets.task_count(shards, frames, max(1, sum(client.nthreads().values())), tasks)
        # `pure=False`: Dask must not reuse the result of a task of another call.
        futures = [
            client.submit(_task, recipe, out, frames, seed, (task, tasks), options, retries=_RETRIES, pure=False)
            for task in range(tasks)
        ]
        try:
            while progress is not None and not all(future.done() for future in futures):
                reporter.update()
                time.sleep(0.2)
            client.gather(futures)
        except BaseException:
            # The first failed task cancels the others.
            client.cancel(futures)
            raise
        reporter.finish()
    finally:
        if own is not None:
            own.close()
    return _sets.merge(out, frames)
