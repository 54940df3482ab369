"""Ray queries for trimesh by raybalance: `mesh.ray = raybalance.trimesh.RayMeshIntersector(mesh)`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from trimesh.ray.ray_util import contains_points

from . import _arrays
from ._scene import Scene
from ._tracer import Tracer

Ids = NDArray[np.int64]

# Below this share of a plane's and a ray's length, the ray is along the plane: where it meets it is not computed from
# the plane, but from the distance in single precision.
_ALONG = 1e-9


class RayMeshIntersector:
    """What trimesh asks of a mesh's `ray`, with hits that are exact: a closed mesh has no gaps.

    The mesh may change: its tree is built anew before the next query. Rays that are no numbers, or have no direction,
    miss.

    Parameters
    ----------
    geometry
        A `trimesh.Trimesh`.
    devices
        As for `raybalance.Tracer`. Queries are small mostly, so the usual is one device of all cores.
    scale_to_box
        Taken for compatibility; hits do not depend on a mesh's size.
    """

    def __init__(self, geometry: Any, devices: str = "cpu", scale_to_box: bool = True) -> None:
        self.mesh = geometry
        self._devices = devices
        self._tracer: Tracer | None = None
        self._made_of: Any = None

    def _current(self) -> Tracer:
        """The tracer of the mesh as it is now."""
        made_of = hash(self.mesh)
        if self._tracer is None or self._made_of != made_of:
            scene = Scene(np.asarray(self.mesh.vertices), np.asarray(self.mesh.faces), name="trimesh")
            self._tracer, self._made_of = Tracer(scene, self._devices), made_of
        return self._tracer

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 100,
        return_locations: bool = False,
    ) -> Any:
        """The triangles that rays hit: `index_tri, index_ray`, and with `return_locations` M × 3 `locations`.

        Hits of a ray follow each other by distance, those of different rays are mixed. Of triangles that a ray meets at
        the same distance, at an edge say, the first counts alone. A ray has at most `max_hits`.
        """
        tracer = self._current()
        origins, directions = _rays(ray_origins, ray_directions)
        triangles, rays, distances = [], [], []
        live = np.arange(len(origins))
        tmin = np.zeros(len(origins), dtype=np.float32)
        for _ in range(max_hits if multiple_hits else min(max_hits, 1)):
            if not len(live):
                break
            run = tracer.run(origins[live], directions[live], tmin, invalid="miss")
            live = live[run.hit]
            triangles.append(run.prim_id[run.hit].astype(np.int64))
            rays.append(live)
            distances.append(run.t[run.hit])
            # Beyond what was hit, and no farther.
            tmin = np.nextafter(distances[-1], np.float32(np.inf))
        index_tri, index_ray = _joined(triangles), _joined(rays)
        if not return_locations:
            return index_tri, index_ray
        distance = np.concatenate(distances) if distances else np.zeros(0, dtype=np.float32)
        return index_tri, index_ray, self._locations(origins, directions, index_ray, index_tri, distance)

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[NDArray[np.float64], Ids, Ids]:
        """Where rays hit: M × 3 `locations`, `index_ray`, `index_tri`."""
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True
        )
        return locations, index_ray, index_tri

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> Ids:
        """The triangle that each ray hits first; −1 for a miss."""
        run = self._current().run(*_rays(ray_origins, ray_directions), invalid="miss")
        return run.prim_id.astype(np.int64)

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Whether each ray hits anything."""
        run = self._current().run(*_rays(ray_origins, ray_directions), query="any", invalid="miss")
        return run.hit

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether the mesh, which should be closed, contains each point; either is possible on its surface."""
        return contains_points(self, points)

    def _locations(
        self,
        origins: NDArray[Any],
        directions: NDArray[Any],
        index_ray: Ids,
        index_tri: Ids,
        distance: NDArray[np.float32],
    ) -> NDArray[np.float64]:
        """Where rays meet their triangles' planes, in double precision."""
        start, way = origins[index_ray].astype(np.float64), directions[index_ray].astype(np.float64)
        corners = np.asarray(self.mesh.vertices, dtype=np.float64)[np.asarray(self.mesh.faces)[index_tri]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across = np.einsum("ij,ij->i", normal, way)
        height = np.einsum("ij,ij->i", normal, corners[:, 0] - start)
        least = _ALONG * np.linalg.norm(normal, axis=1) * np.linalg.norm(way, axis=1)
        t = distance.astype(np.float64)
        np.divide(height, across, out=t, where=np.abs(across) > least)
        return start + way * t[:, None]

    # Devices are no part of a copy: it opens its own.
    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_tracer": None, "_made_of": None}

    def __copy__(self, *_: Any) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, self._devices)

    __deepcopy__ = __copy__


def _rays(origins: ArrayLike, directions: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    starts, ways = _arrays.points("ray_origins", origins), _arrays.points("ray_directions", directions)
    if starts.shape != ways.shape:
        raise ValueError(
            f"ray_directions: shape {ways.shape}, but ray_origins have {starts.shape}: give a direction for each origin"
        )
    return starts, ways


def _joined(parts: list[Ids]) -> Ids:
    return np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)
