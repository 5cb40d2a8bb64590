"""Images by index, for training loops."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from . import _native
from ._render import engine

__all__ = ["Dataset", "IterableDataset"]


class Dataset:
    """Images that are made when they are asked for.

    The same index gives the same sample in every process, so that a ``torch.utils.data.DataLoader`` sees the same data with any number of
    workers. It can be pickled, and says so if it was pickled by a version that would have given other images.

    Parameters
    ----------
    recipe : None, str, os.PathLike or dict
        As of `papsynth.render`. A file is read once, here.
    seed : int
        The data set.
    length : int
        Number of images.
    start : int
        Index of the first.
    transform : callable, optional
        What each `Frame` becomes; by default it stays one.
    model : None, str or os.PathLike
        A model or a class file.
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
                raise TypeError(f"{name}: {value!r} is no whole number")
            if not least <= value.__index__() < 2**64:
                raise ValueError(f"{name}: {value} is out of range; expected {least} to 2**64 - 1")
        self.seed, self.length, self.start = seed.__index__(), length.__index__(), start.__index__()
        self.transform = transform
        self._recipe, self._model = recipe, model
        self._engine = engine(recipe, model)

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, index: int) -> Any:
        if isinstance(index, bool) or not hasattr(index, "__index__"):
            raise TypeError(f"index: {index!r} is no whole number")
        index = index.__index__()
        if not -self.length <= index < self.length:
            raise IndexError(f"index {index} is out of range for {self.length} images")
        frame = self._engine.render(self.seed, self.start + index % self.length)
        return frame if self.transform is None else self.transform(frame)

    def __iter__(self) -> Iterator[Any]:
        return (self[index] for index in range(self.length))

    def __getstate__(self) -> dict:
        state = {name: value for name, value in vars(self).items() if name != "_engine"}
        return {**state, "_made_by": _native.identity()}

    def __setstate__(self, state: dict) -> None:
        made_by = state.pop("_made_by", None)
        if made_by != _native.identity():
            raise ValueError(
                f"this data set was pickled by papsynth {made_by}, whose images are others than those of {_native.identity()}"
            )
        vars(self).update(state)
        self._engine = engine(self._recipe, self._model)

    def __repr__(self) -> str:
        return f"<papsynth.Dataset of {self.length} images, seed {self.seed}>"


class IterableDataset:
    """The same, one after the other and shared between the workers of a loader: worker k of n makes every n-th.

    Parameters
    ----------
    dataset : Dataset
    """

    def __init__(self, dataset: Dataset) -> None:
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
