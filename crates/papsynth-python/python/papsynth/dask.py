"""Data sets made by a Dask cluster: one task a share of the shards."""

from __future__ import annotations

import os
from typing import Any

from . import _sets

__all__ = ["generate"]

_RETRIES = 20


def _share(recipe, out, frames, seed, share, options):
    _sets.generate(recipe, out, frames, seed, share=share, **options)
    return share[0]


def generate(
    recipe: Any,
    out: str | os.PathLike[str],
    frames: int,
    seed: int = 0,
    *,
    client: Any = None,
    shares: int | None = None,
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
    shares : int, optional
        Number of tasks; by default one a shard, but of 64 frames at least where that leaves each thread four.
    **options
        As of `papsynth.generate`: formats, frames_per_shard, threads, verify, model.

    Returns
    -------
    str
        The root hash.
    """
    try:
        from dask.distributed import Client, get_client, wait
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("papsynth.dask needs Dask: pip install 'papsynth[dask]'", name="dask") from error
    # What is wrong is said before a cluster is begun.
    _sets.tasks(recipe, frames, 1, options)
    own = None
    if client is None:
        try:
            client = get_client()
        except ValueError:
            client = own = Client()
    try:
        out = _sets.place(out)
        most = _sets.tasks(recipe, frames, max(1, sum(client.nthreads().values())), options)
        shares = most if shares is None else max(1, min(shares, frames))
        # Names of their own: a task of another call is never taken for one of these.
        tasks = [
            client.submit(_share, recipe, out, frames, seed, (share, shares), options, retries=_RETRIES, pure=False)
            for share in range(shares)
        ]
        wait(tasks)
        client.gather(tasks)
    finally:
        if own is not None:
            own.close()
    return _sets.merge(out, frames)
