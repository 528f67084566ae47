# Types of the compiled part, written by hand. mypy's stubtest holds them against it.
import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal, NoReturn, Protocol, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

from . import Occluders, SunPositions

class _Bar(Protocol):
    def update(self, n: int, /) -> object: ...

_Progress = Callable[[int, int], object] | _Bar
_Quality = Literal["default", "fast"]
_Up = Literal["y", "z"]
_Weighting = Literal["cosine", "uniform"]

class _Ids(Protocol):
    """What names a triangle for each ray: hits, or what ``occluder`` returns."""
    @property
    def triangle(self) -> NDArray[np.int32]: ...
    @property
    def mesh(self) -> NDArray[np.int32]: ...
    @property
    def instance(self) -> NDArray[np.int32]: ...

_Exclude = _Ids | ArrayLike

__all__ = [
    "BitMatrix",
    "ChildOrder",
    "Closest",
    "DegenerateWarning",
    "HitList",
    "Hits",
    "Map",
    "Picture",
    "Queries",
    "Scene",
    "World",
    "_Field",
    "__version__",
    "_sun_positions",
    "_suns",
    "get_threads",
    "heat_map",
    "render",
    "set_threads",
    "sky_patches",
    "texel_atlas",
]

__version__: str

class DegenerateWarning(UserWarning): ...

def set_threads(threads: int | None = None) -> None: ...
def get_threads() -> int: ...
def texel_atlas(
    vertices: ArrayLike,
    faces: ArrayLike,
    uvs: ArrayLike,
    size: int,
    normals: ArrayLike | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.int64]]: ...
def sky_patches(
    patches: int = 145, *, uniform: bool = False, up: _Up = "z", north: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def _sun_positions(
    latitude: float,
    longitude: float,
    height: float,
    times: Sequence[float],
    refraction: bool,
    up: _Up,
    north: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
def _suns(suns: Any, weights: ArrayLike | None, up: _Up) -> tuple[Any, Any]: ...
def heat_map(
    values: ArrayLike, low: float | None = None, high: float | None = None, *, legend: bool = True
) -> Picture: ...
def render(
    path: str | os.PathLike[str],
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    seed: int = 0,
    standard_error: bool = False,
    threads: int | None = None,
    progress: _Progress | None = None,
) -> Picture: ...

@disjoint_base
class Queries:
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def faces(self) -> NDArray[np.int64]: ...
    @property
    def normals(self) -> NDArray[np.float32]: ...
    def set_masks(self, masks: ArrayLike | None, instances: ArrayLike | None = None) -> None: ...
    def _repr_html_(self) -> str: ...
    def __sizeof__(self) -> int: ...
    def save(self, path: str | os.PathLike[str]) -> None: ...
    @property
    def report(self) -> dict[str, int]: ...
    @property
    def origin(self) -> tuple[float, float, float]: ...
    @property
    def paths(self) -> NDArray[np.int64]: ...
    @property
    def bounds(self) -> NDArray[np.float64]: ...
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        mask: ArrayLike | None = None,
        exclude: _Exclude | None = None,
        out: NDArray[np.bool_] | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.bool_]: ...
    def visible(
        self,
        a: ArrayLike,
        b: ArrayLike,
        *,
        margin: float | None = None,
        out: NDArray[np.bool_] | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.bool_]: ...
    def occluder(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        mask: ArrayLike | None = None,
        exclude: _Exclude | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Occluders: ...
    def intersect(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        mask: ArrayLike | None = None,
        exclude: _Exclude | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Hits: ...
    def intersect_all(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        max_hits: int | None = None,
        distinct: bool = False,
        mask: ArrayLike | None = None,
        exclude: _Exclude | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> HitList: ...
    def count(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        distinct: bool = False,
        mask: ArrayLike | None = None,
        exclude: _Exclude | None = None,
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
    def signed_distance(
        self,
        points: ArrayLike,
        *,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.float32]: ...
    def closest(
        self,
        points: ArrayLike,
        max_distance: ArrayLike | None = None,
        *,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Closest: ...
    def visibility(
        self,
        a: ArrayLike,
        b: ArrayLike | None = None,
        *,
        margin: float | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> BitMatrix: ...
    def sees(
        self,
        points: ArrayLike,
        normals: ArrayLike | None,
        directions: ArrayLike,
        *,
        distance: float = ...,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> BitMatrix: ...
    @overload
    def ambient_occlusion(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        samples: int = 256,
        distance: float = ...,
        *,
        two_sided: bool = False,
        weighting: _Weighting = "cosine",
        seed: int = 0,
        bent: Literal[False] = False,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.float32]: ...
    @overload
    def ambient_occlusion(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        samples: int = 256,
        distance: float = ...,
        *,
        two_sided: bool = False,
        weighting: _Weighting = "cosine",
        seed: int = 0,
        bent: Literal[True],
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
    def sky_view(
        self,
        points: ArrayLike,
        normals: ArrayLike | None = None,
        patches: int = 145,
        *,
        uniform: bool = False,
        weighting: _Weighting = "cosine",
        up: _Up = "z",
        north: float = 0.0,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.float32]: ...
    def sun_hours(
        self,
        points: ArrayLike,
        normals: ArrayLike | None,
        suns: SunPositions | ArrayLike,
        weights: ArrayLike | None = None,
        *,
        up: _Up = "z",
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> NDArray[np.float64]: ...
    def sensor_grid(
        self, spacing: float, *, up: _Up = "z"
    ) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.int64]]: ...
    def _irradiation(
        self,
        points: ArrayLike,
        normals: ArrayLike | None,
        place: tuple[float, float, float],
        times: Sequence[float],
        steps: Sequence[ArrayLike],
        sky: tuple[int, bool, _Up, float],
        threads: int | None,
        progress: _Progress | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def _first_triangles(
        self, origins: ArrayLike, directions: ArrayLike, *, threads: int | None = None
    ) -> NDArray[np.int64]: ...
    def _distinct_hits(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        vertices: ArrayLike,
        *,
        max_hits: int,
        offset: float,
        threads: int | None = None,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]: ...

@final
class Scene(Queries):
    def __new__(
        cls,
        vertices: Any,
        faces: ArrayLike | None = None,
        *,
        instances: Iterable[Any] | None = None,
        origin: ArrayLike | None = None,
        masks: ArrayLike | None = None,
        quality: _Quality = "default",
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Scene: ...
    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        *,
        quality: _Quality = "default",
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Scene: ...
    @classmethod
    def from_heights(
        cls,
        heights: Any,
        transform: Iterable[float] | None = None,
        *,
        origin: ArrayLike | None = None,
        quality: _Quality = "default",
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Scene: ...
    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene: ...
    def learn(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Scene: ...
    @staticmethod
    def _from_bytes(bytes: NDArray[np.uint8]) -> Scene: ...
    def __reduce__(self) -> tuple[Callable[..., Scene], tuple[Any, ...]]: ...

@final
class ChildOrder:
    pass

@final
class World(Queries):
    def __new__(
        cls,
        meshes: Any,
        transforms: ArrayLike | None = None,
        objects: ArrayLike | None = None,
        *,
        ground: Any = None,
        origin: ArrayLike | None = None,
        quality: _Quality = "default",
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> World: ...
    def set_instances(
        self, transforms: ArrayLike, objects: ArrayLike | None = None, *, threads: int | None = None
    ) -> None: ...
    def refit(self, vertices: dict[int, Any], *, threads: int | None = None) -> None: ...
    def relearn(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        distance: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        adopt: bool = True,
        threads: int | None = None,
    ) -> ChildOrder: ...
    def adopt(self, order: ChildOrder) -> None: ...
    @property
    def transforms(self) -> NDArray[np.float64]: ...
    @property
    def objects(self) -> NDArray[np.int64]: ...
    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> World: ...
    @staticmethod
    def _from_bytes(bytes: NDArray[np.uint8]) -> World: ...
    def __reduce__(self) -> tuple[Callable[..., World], tuple[Any, ...]]: ...

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
    def curve(self) -> NDArray[np.int32]: ...
    @property
    def along(self) -> NDArray[np.float32]: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NoReturn: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Any, /) -> Hits: ...
    def to_dict(self, *, point: bool = False, normal: bool = False) -> dict[str, NDArray[Any]]: ...
    def _repr_html_(self) -> str: ...
    def __sizeof__(self) -> int: ...
    @staticmethod
    def _restore(state: Any) -> Hits: ...
    def __reduce__(self) -> tuple[Callable[..., Hits], tuple[Any, ...]]: ...

@final
class HitList(Hits):
    @property
    def splits(self) -> NDArray[np.int64]: ...
    @property
    def ray(self) -> NDArray[np.int64]: ...
    def __len__(self) -> int: ...
    def __getitem__(self, ray: int, /) -> Hits: ...
    def to_dict(self, *, point: bool = False, normal: bool = False) -> dict[str, NDArray[Any]]: ...
    def _repr_html_(self) -> str: ...
    @staticmethod
    def _restore_list(splits: NDArray[np.int64], state: Any) -> HitList: ...
    def __reduce__(self) -> tuple[Callable[..., HitList], tuple[Any, ...]]: ...

@final
class Closest(Hits):
    @property
    def distance(self) -> NDArray[np.float32]: ...
    def __getitem__(self, index: Any, /) -> Closest: ...
    def to_dict(self, *, point: bool = False, normal: bool = False) -> dict[str, NDArray[Any]]: ...
    def _repr_html_(self) -> str: ...
    @staticmethod
    def _restore(state: Any) -> Closest: ...

@final
class BitMatrix:
    def __new__(cls, words: NDArray[np.uint64], columns: int) -> BitMatrix: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def words(self) -> NDArray[np.uint64]: ...
    @overload
    def count(self, axis: None = None) -> int: ...
    @overload
    def count(self, axis: int) -> NDArray[np.int64]: ...
    def sums(self, weights: ArrayLike) -> NDArray[np.float64]: ...
    def unpack(self, rows: slice | None = None) -> NDArray[np.bool_]: ...
    def to_numpy(self) -> NDArray[np.bool_]: ...
    @overload
    def __getitem__(self, index: tuple[int, int], /) -> bool: ...
    @overload
    def __getitem__(self, index: Any, /) -> NDArray[np.bool_]: ...
    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]: ...
    @overload
    def __and__(self, other: BitMatrix, /) -> BitMatrix: ...
    @overload
    def __and__(self, other: NDArray[np.bool_], /) -> NDArray[np.bool_]: ...
    @overload
    def __or__(self, other: BitMatrix, /) -> BitMatrix: ...
    @overload
    def __or__(self, other: NDArray[np.bool_], /) -> NDArray[np.bool_]: ...
    @overload
    def __xor__(self, other: BitMatrix, /) -> BitMatrix: ...
    @overload
    def __xor__(self, other: NDArray[np.bool_], /) -> NDArray[np.bool_]: ...
    def __rand__(self, other: Any, /) -> Any: ...
    def __ror__(self, other: Any, /) -> Any: ...
    def __rxor__(self, other: Any, /) -> Any: ...
    def __invert__(self) -> BitMatrix: ...
    @property
    def T(self) -> BitMatrix: ...
    @property
    def nbytes(self) -> int: ...
    def __sizeof__(self) -> int: ...
    def _repr_html_(self) -> str: ...
    def __len__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[type[BitMatrix], tuple[Any, ...]]: ...

@final
class _Field:
    def __new__(cls, heights: NDArray[np.float64], transform: Sequence[float]) -> _Field: ...
    def horizons(self, azimuths: Any, rise: float, drop: float, options: Any) -> tuple[NDArray[np.float32], Any]: ...
    def sky(self, measure: int, azimuths: Any, rise: float, options: Any) -> tuple[NDArray[np.float32], Any]: ...
    def lit(self, lights: Any, rise: float, options: Any) -> tuple[NDArray[np.bool_], Any]: ...
    def sun_hours(self, suns: Any, hours: Any, place: Any, options: Any) -> tuple[NDArray[np.float64], Any]: ...
    def viewshed(self, sight: Any, options: Any) -> tuple[NDArray[np.bool_], int]: ...
    def target_heights(self, sight: Any, options: Any) -> tuple[NDArray[np.float32], int]: ...

@final
class Map:
    def __new__(
        cls,
        values: ArrayLike,
        cell: float,
        *,
        title: str = "",
        subtitle: str = "",
        quantity: str = "",
        unit: str = "",
        range: tuple[float, float] | None = None,
        metres: float | None = 1.0,
        north: float = 0.0,
        heights: ArrayLike | None = None,
        source: str = "",
        size: tuple[int, int] | None = None,
        dark: bool = False,
    ) -> Map: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def range(self) -> tuple[float, float]: ...
    def save(self, path: str | os.PathLike[str]) -> None: ...
    def plot(self, ax: Any = None) -> Any: ...
    def _repr_png_(self) -> bytes: ...

@final
class Picture:
    def __new__(cls, pixels: ArrayLike) -> Picture: ...
    @property
    def pixels(self) -> NDArray[np.float32] | NDArray[np.uint8]: ...
    @property
    def aov(self) -> dict[str, NDArray[np.float32]]: ...
    def save(self, path: str | os.PathLike[str]) -> None: ...
    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]: ...
    def _repr_png_(self) -> bytes: ...
