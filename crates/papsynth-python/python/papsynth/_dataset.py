"""Data sets for training loops."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterator
from typing import Any

from . import _native
from ._render import engine

__all__ = ["Dataset", "IterableDataset"]


def _own(given: Any) -> Any:
    """Return a copy of a recipe or model, with absolute paths."""
    if hasattr(given, "to_dict"):
        given = given.to_dict()
    if isinstance(given, (str, os.PathLike)):
        return os.path.abspath(given) if os.path.exists(given) else given
    return copy.deepcopy(given)


class Dataset:
    """A data set that generates images on access.

    An index gives the same sample in every process, so a ``torch.utils.data.DataLoader`` returns the same data with any
    number of workers. The data set can be pickled. Unpickling fails in a version that gives other images.

    Parameters
    ----------
    recipe : None, str, os.PathLike or dict
        As for `papsynth.render`. A file is read again when the data set is unpickled, which fails if the file has
        changed.
    seed : int
        Seed of the data set.
    length : int
        Number of images.
    start : int
        Index of the first image.
    transform : callable, optional
        Function of a `Frame` that returns the sample. Default: the frame. `papsynth.semantic_target` and
        `papsynth.detection_target` return targets in which nuclei that cannot be seen are ignored.
    model : None, dict, str or os.PathLike
        As for `papsynth.render`.
    """

    def __init__(
        self,
        recipe: Any = None,
        seed: int = 0,
        length: int = 1,
        *,
        start: int = 0,
        transform: Callable[[_native.Frame], Any] | None = None,
        model: Any = None,
    ) -> None:
        for name, value, least in (("seed", seed, 0), ("length", length, 1), ("start", start, 0)):
            if isinstance(value, bool) or not hasattr(value, "__index__"):
                raise TypeError(f"{name}: expected an integer, found {value!r}")
            if not least <= value.__index__() < 2**64:
                raise ValueError(f"{name}: {value} is out of range: expected {least} to 2**64 - 1")
        self.seed, self.length, self.start = seed.__index__(), length.__index__(), start.__index__()
        if self.length >= 2**63 or self.start + self.length > 2**64:
            raise ValueError(f"start, length: {start}, {length}: expected a length below 2**63 and indices below 2**64")
        if transform is not None and not callable(transform):
            raise TypeError(f"transform: expected a callable, found {transform!r}")
        self.transform = transform
        self._recipe, self._model = _own(recipe), _own(model)
        self._engine = engine(recipe, model)

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, index: int) -> Any:
        if isinstance(index, bool) or not hasattr(index, "__index__"):
            raise TypeError(f"index: expected an integer, found {index!r}")
        index = index.__index__()
        if not -self.length <= index < self.length:
            raise IndexError(f"index {index} is out of range for {self.length} images")
        frame = self._engine.render(self.seed, self.start + index % self.length)
        return frame if self.transform is None else self.transform(frame)

    def __iter__(self) -> Iterator[Any]:
        return (self[index] for index in range(self.length))

    def __getstate__(self) -> dict:
        state = {name: value for name, value in vars(self).items() if name != "_engine"}
        return {**state, "_made_by": _native.identity(), "_identity": self._engine.identity}

    def __setstate__(self, state: dict) -> None:
        made_by = state.pop("_made_by", None)
        if made_by != _native.identity():
            raise ValueError(
                f"this data set was pickled by papsynth {made_by}, which gives other images than {_native.identity()}"
            )
        identity = state.pop("_identity", None)
        vars(self).update(state)
        self._engine = engine(self._recipe, self._model)
        if self._engine.identity != identity:
            raise ValueError("the recipe or model file of this data set has changed since it was pickled")

    def __repr__(self) -> str:
        return f"<papsynth.Dataset of {self.length} images, seed {self.seed}>"


class IterableDataset:
    """Iterates over a `Dataset`. Worker k of n of a ``DataLoader`` returns every n-th sample.

    Parameters
    ----------
    dataset : Dataset
    """

    def __init__(self, dataset: Dataset) -> None:
        if not isinstance(dataset, Dataset):
            raise TypeError(f"dataset: expected a papsynth.Dataset, found {dataset!r}")
        self.dataset = dataset

    def __len__(self) -> int:
        return len(self.dataset)

    def __iter__(self) -> Iterator[Any]:
        first, step = 0, 1
        try:
            from torch.utils.data import get_worker_info
        except ModuleNotFoundError:
            info = None
        else:
            info = get_worker_info()
        if info is not None:
            first, step = info.id, info.num_workers
        return (self.dataset[index] for index in range(first, len(self.dataset), step))
