# Types of the compiled part, written by hand. mypy's stubtest holds them against it.
import os
from collections.abc import Callable, Iterable
from typing import Any, Protocol, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

class _Bar(Protocol):
    def update(self, n: int, /) -> object: ...

_Progress = Callable[[int, int], object] | _Bar

__all__ = [
    "Closest",
    "DegenerateWarning",
    "HitList",
    "Hits",
    "Scene",
    "__version__",
    "get_threads",
    "set_threads",
]

__version__: str

class DegenerateWarning(UserWarning): ...

def set_threads(threads: int | None = None) -> None: ...
def get_threads() -> int: ...

@final
class Scene:
    def __new__(
        cls,
        vertices: Any,
        faces: ArrayLike | None = None,
        *,
        instances: Iterable[Any] | None = None,
        origin: ArrayLike | None = None,
        quality: str = "default",
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Scene: ...
    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        *,
        quality: str = "default",
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Scene: ...
    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene: ...
    def save(self, path: str | os.PathLike[str]) -> None: ...
    @property
    def report(self) -> dict[str, int]: ...
    @property
    def origin(self) -> tuple[float, float, float]: ...
    @property
    def bounds(self) -> NDArray[np.float64]: ...
    def learn(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Scene: ...
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.bool_]: ...
    def visible(
        self,
        a: ArrayLike,
        b: ArrayLike,
        *,
        margin: float = 0.0,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.bool_]: ...
    def intersect(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Hits: ...
    def intersect_all(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        max_hits: int | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> HitList: ...
    def count(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.int32]: ...
    def contains(
        self,
        points: ArrayLike,
        *,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.bool_]: ...
    def closest(
        self,
        points: ArrayLike,
        max_distance: float = ...,
        *,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Closest: ...
    def _corners(
        self,
        triangle: NDArray[np.int32],
        mesh: NDArray[np.int32],
        instance: NDArray[np.int32],
    ) -> NDArray[np.float64]: ...
    @staticmethod
    def _from_bytes(bytes: NDArray[np.uint8]) -> Scene: ...
    def __reduce__(self) -> tuple[Callable[..., Scene], tuple[Any, ...]]: ...

@disjoint_base
class Hits:
    @property
    def t(self) -> NDArray[np.float32]: ...
    @property
    def triangle(self) -> NDArray[np.int32]: ...
    @property
    def mesh(self) -> NDArray[np.int32]: ...
    @property
    def instance(self) -> NDArray[np.int32]: ...
    @property
    def uv(self) -> NDArray[np.float32]: ...
    @property
    def hit(self) -> NDArray[np.bool_]: ...
    @property
    def point(self) -> NDArray[np.float64]: ...
    @property
    def normal(self) -> NDArray[np.float32]: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @staticmethod
    def _restore(state: Any) -> Hits: ...
    def __reduce__(self) -> tuple[Callable[..., Hits], tuple[Any, ...]]: ...

@final
class HitList(Hits):
    @property
    def splits(self) -> NDArray[np.int64]: ...
    @property
    def ray(self) -> NDArray[np.int64]: ...
    @staticmethod
    def _restore_list(splits: NDArray[np.int64], state: Any) -> HitList: ...
    def __reduce__(self) -> tuple[Callable[..., HitList], tuple[Any, ...]]: ...

@final
class Closest:
    @property
    def distance(self) -> NDArray[np.float32]: ...
    @property
    def point(self) -> NDArray[np.float64]: ...
    @property
    def triangle(self) -> NDArray[np.int32]: ...
    @property
    def mesh(self) -> NDArray[np.int32]: ...
    @property
    def instance(self) -> NDArray[np.int32]: ...
    @property
    def uv(self) -> NDArray[np.float32]: ...
    @staticmethod
    def _restore(state: Any) -> Closest: ...
    def __reduce__(self) -> tuple[Callable[..., Closest], tuple[Any, ...]]: ...
