"""Data sets made by a Ray cluster: a task a part of the shards."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

from . import _sets
from ._dataset import Dataset

__all__ = ["dataset", "generate"]

# Ray itself does not try again what an exception ended.
_RETRIES = 20


def _ray():
    try:
        import ray
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("papsynth.ray needs Ray: pip install 'papsynth[ray]'", name="ray") from error
    return ray


def _part(recipe, out, frames, seed, shard, options):
    _sets.generate(recipe, out, frames, seed, shard=shard, **options)


def generate(
    recipe: Any,
    out: str | os.PathLike[str],
    frames: int,
    seed: int = 0,
    *,
    shards: int | None = None,
    progress: Callable[[int, int], object] | None = None,
    **options: Any,
) -> str:
    """Makes a data set in a folder that all nodes share, or in an object store whose keys they have, and closes it.

    Tasks are tried again when their worker dies or the system refuses to write. If this process dies, the same call goes on: what there is
    is known from commit records alone.

    Parameters
    ----------
    recipe, out, frames, seed
        As of `papsynth.generate`.
    shards : int, optional
        Into how many parts the work is divided, a task each, as n of `--shard i/n`; by default one for each shard that is written, but of
        64 frames at least where that leaves each processor four. What a task has at work is lost with its worker, but for what is whole.
    progress : callable, optional
        Called with the number of shards that are written whole, and of all, from commit records: what was there before counts.
    **options
        As of `papsynth.generate`: formats, frames_per_shard, scenes, threads, verify, model.

    Returns
    -------
    str
        The root hash.
    """
    ray = _ray()
    # What is wrong is said before a cluster is begun.
    written = _sets.written(recipe, frames, options)
    _sets.tasks(written, frames, 1, shards)
    if not ray.is_initialized():
        ray.init()
    out = _sets.place(out)
    told = _sets.Told(out, frames, written, progress)
    parts = _sets.tasks(written, frames, max(1, int(ray.cluster_resources().get("CPU", 1))), shards)
    task = ray.remote(max_retries=_RETRIES, retry_exceptions=[OSError], num_cpus=options.get("threads", 1))(_part)
    pending = [task.remote(recipe, out, frames, seed, (part, parts), options) for part in range(parts)]
    try:
        while pending:
            ready, pending = ray.wait(pending, num_returns=len(pending), timeout=1.0)
            ray.get(ready)
            told.now_and_then()
    except BaseException:
        # One that cannot be made ends all: nobody waits for the others.
        for one in pending:
            ray.cancel(one)
        raise
    told.finish()
    return _sets.merge(out, frames)


def dataset(
    recipe: Any = None,
    seed: int = 0,
    length: int = 1,
    *,
    transform: Callable[[Any], Any] | None = None,
    ahead: int | None = None,
    **options: Any,
) -> Iterator[Any]:
    """Samples in the order of their indices, made by the cluster while a trainer works.

    Parameters
    ----------
    recipe, seed, length, transform
        As of `papsynth.Dataset`. Without a transform a sample is a dictionary of image, labels and boxes.
    ahead : int, optional
        Samples that are made or wait to be taken at most; by default twice the processors of the cluster.

    Yields
    ------
    sample
    """
    ray = _ray()
    samples = Dataset(recipe, seed, length, transform=transform or _arrays, **options)
    return _stream(ray, samples, ahead)


def _stream(ray: Any, samples: Dataset, ahead: int | None) -> Iterator[Any]:
    if not ray.is_initialized():
        ray.init()
    held = ray.put(samples)
    task = ray.remote(max_retries=_RETRIES, num_cpus=1)(_sample)
    if ahead is None:
        ahead = 2 * max(1, int(ray.cluster_resources().get("CPU", 1)))
    waiting: list[Any] = []
    for index in range(len(samples)):
        waiting.append(task.remote(held, index))
        if len(waiting) >= max(1, ahead):
            yield ray.get(waiting.pop(0))
    while waiting:
        yield ray.get(waiting.pop(0))


def _sample(samples, index):
    return samples[index]


def _arrays(frame):
    return {"image": frame.image, "labels": frame.labels, "boxes": frame.boxes, "table": frame.table}
