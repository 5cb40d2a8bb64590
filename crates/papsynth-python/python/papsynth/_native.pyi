from collections.abc import Callable
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

class Engine:
    def __new__(cls, recipe: Any = None, model: dict[str, Any] | str | PathLike[str] | None = None) -> Engine: ...
    def render(
        self,
        seed: int = 0,
        index: int = 0,
        *,
        threads: int = 1,
        scene: dict[str, Any] | str | PathLike[str] | None = None,
    ) -> Frame: ...
    def scene(self, seed: int = 0, index: int = 0) -> dict[str, Any]: ...
    @property
    def recipe(self) -> str: ...
    @property
    def identity(self) -> str: ...
    @property
    def names_files(self) -> bool: ...
    def _repr_html_(self) -> str | None: ...

class Frame:
    def save(self, path: str | PathLike[str]) -> None: ...
    def semantic(self, classes: list[str] | None = None, *, min_detectability: float = ...) -> NDArray[np.uint8]: ...
    def ignored(self, min_detectability: float = ...) -> NDArray[np.bool_]: ...
    @property
    def seed(self) -> int: ...
    @property
    def index(self) -> int: ...
    @property
    def slide(self) -> int: ...
    @property
    def pixel_um(self) -> float: ...
    @property
    def planes_um(self) -> list[float]: ...
    @property
    def bits(self) -> int: ...
    @property
    def image(self) -> NDArray[np.uint8] | NDArray[np.uint16]: ...
    @property
    def stack(self) -> NDArray[np.uint8] | NDArray[np.uint16]: ...
    @property
    def noise_free(self) -> NDArray[np.float32]: ...
    @property
    def labels(self) -> dict[str, NDArray[np.int32]]: ...
    @property
    def layers(self) -> NDArray[np.uint16]: ...
    @property
    def masks(self) -> NDArray[np.bool_]: ...
    @property
    def visible_masks(self) -> NDArray[np.bool_]: ...
    @property
    def boxes(self) -> NDArray[np.int32]: ...
    @property
    def rle(self) -> list[dict[str, Any]]: ...
    @property
    def visible_rle(self) -> list[dict[str, Any]]: ...
    @property
    def table(self) -> dict[str, NDArray[Any]]: ...
    @property
    def defocus_um(self) -> NDArray[np.float64]: ...
    @property
    def detectability(self) -> NDArray[np.float64]: ...
    def _repr_png_(self) -> bytes: ...
    def __len__(self) -> int: ...

SEMANTIC_CLASSES: tuple[str, ...]
MIMICS: tuple[str, ...]
MIN_DETECTABILITY: float
IGNORED: int

def identity() -> str: ...
def _restored(version: int, key: Any, scale: Any, arrays: Any, objects: Any) -> Frame: ...
def presets() -> list[tuple[str, str]]: ...
def recipe_schema() -> str: ...
def resolve(recipe: Any = None, widen: float = 1.0) -> str: ...
def generate(
    engine: Engine,
    out: str | PathLike[str],
    frames: int,
    seed: int = 0,
    *,
    task: tuple[int, int] = (0, 1),
    formats: list[str] | None = None,
    frames_per_shard: int | None = None,
    without: list[str] | None = None,
    scenes: bool = False,
    threads: int = 1,
    verify: bool = False,
    progress: Callable[[int], object] | None = None,
    min_detectability: float = ...,
) -> dict[str, int]: ...
def match_fields(
    real: list[Any],
    pixel_um: float,
    full_scale: float,
    *,
    recipe: Any = None,
    nuclei: list[Any] | None = None,
    find_pixel: bool = False,
    simulations: int | None = None,
    refine: int = 0,
    quick: bool = False,
    seed: int = 0,
    model: Any = None,
    threads: int = 0,
) -> tuple[str, str, str]: ...
def merge(out: str | PathLike[str], frames: int) -> str: ...
def shards(
    frames: int, formats: list[str] | None = None, frames_per_shard: int | None = None, without: list[str] | None = None
) -> int: ...
def missing(out: str | PathLike[str], frames: int) -> list[int]: ...
def verify(out: str | PathLike[str], frames: int | None = None) -> dict[str, Any]: ...
def calibrate_microscope(
    stack: list[Any] | None = None,
    edge: Any = None,
    *,
    step_um: float | None = None,
    windows: list[tuple[int, int, int, int]] | None = None,
    line: tuple[float, float, float, float] | None = None,
    pixel_um: float | None = None,
    na: float | None = None,
    wavelength_um: float | None = None,
    mount_index: float | None = None,
    immersion_index: float | None = None,
    threads: int = 0,
) -> str: ...
def calibrate_camera(flats: list[list[Any]], darks: list[Any], bits: int) -> str: ...
def judge(
    real: list[Any],
    synthetic: list[Any],
    pixel_um: float,
    full_scale: float,
    *,
    real_nuclei: list[Any] | None = None,
    synthetic_nuclei: list[Any] | None = None,
    seed: int = 0,
    quick: bool = False,
    features: str = "2",
    threads: int = 0,
) -> str: ...
def learn(
    name: str,
    pixel_um: float,
    *,
    nuclei: list[tuple[Any, Any]] | None = None,
    nucleus_outlines: list[Any] | None = None,
    cytoplasm_outlines: list[Any] | None = None,
    like: str | None = None,
    bethesda: str = "",
    source: str = "",
    numbers_only: bool = False,
    model: Any = None,
) -> str: ...
def _after_fork() -> None: ...
