"""Scenes: triangles, and the tree over them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _raybalance


class Geometry(NamedTuple):
    """A part of a scene: faces that follow each other."""

    name: str
    """As it was given, or as the file calls it; "" where it has none."""
    first: int
    """Its first face."""
    count: int
    """How many there are."""


class Scene:
    """Triangles that rays can be traced through.

    Parameters
    ----------
    vertices
        N × 3 coordinates, in any unit. Contiguous float32 is read as it is. float64 has more digits than devices trace
        in: where single precision would move vertices noticeably, `offset` is subtracted first, and from the origins of
        rays as well.
    faces
        M × 3 integers: the vertices of each triangle. A hit's `prim_id` is a row of this array.
    name
        What reports call the scene.
    builder
        Which tree is built: "sah" or a preset of "ploc"; None for the usual one. It changes no hit.
    invalid
        What to do with triangles that have NaN or infinite vertices: "raise", or "drop": no ray hits them, and the
        others keep their numbers.
    masks
        M integers of 32 bits: rays with `mask=…` pass by faces whose mask has none of its bits. None: all bits.

    Raises
    ------
    ValueError, TypeError
        When an array cannot be taken; the message names it and says what to do.
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        name: str = "arrays",
        builder: str | None = None,
        invalid: str = "raise",
        masks: ArrayLike | None = None,
    ) -> None:
        points = _arrays.points("vertices", vertices)
        self._make(points, _arrays.faces(faces, len(points)), name, builder, invalid, [], masks)

    def _make(
        self,
        points: NDArray[Any],
        corners: NDArray[np.uint32],
        name: str,
        builder: str | None,
        invalid: str,
        geometries: list[tuple[str, int]],
        masks: ArrayLike | None,
    ) -> None:
        drop = _drops(invalid)
        if not drop:
            _check_finite(points, corners)
        bits = None if masks is None else _arrays.masks(masks, len(corners))
        self._native = _raybalance.Scene.of_arrays(points, corners, name, builder, drop, geometries, bits)

    @classmethod
    def of_meshes(
        cls,
        meshes: Mapping[str, Any] | Sequence[Any],
        *,
        name: str = "arrays",
        builder: str | None = None,
        invalid: str = "raise",
        masks: ArrayLike | None = None,
    ) -> Scene:
        """One scene of several meshes, which are its `geometries`: a hit's `geom_id` says which, and its `prim_id` counts
        faces of one mesh after the other.

        Parameters
        ----------
        meshes
            Meshes, or a dictionary of them by name. Each has `vertices` and `faces`, as trimesh's have, or is the two
            of them.
        masks
            A mask for each mesh, or none.

        The others, and what is raised, are as of `Scene`.
        """
        named = list(meshes.items()) if isinstance(meshes, Mapping) else [("", mesh) for mesh in meshes]
        points, corners, geometries = [np.zeros((0, 3), np.float32)], [np.zeros((0, 3), np.uint32)], []
        vertices = faces = 0
        for number, (title, mesh) in enumerate(named):
            try:
                both = (mesh.vertices, mesh.faces) if hasattr(mesh, "faces") else tuple(mesh)
                if len(both) != 2:
                    raise ValueError(f"{len(both)} parts; give vertices and faces, or what has both")
                own = _arrays.points("vertices", both[0])
                triangles = _arrays.faces(both[1], len(own))
            except (TypeError, ValueError) as error:
                raise type(error)(f"meshes[{title or number!r}]: {error}") from None
            if vertices + len(own) >= 2**32 or faces + len(triangles) >= 2**32:
                raise ValueError("meshes: more than 2**32 - 1 vertices or faces in all")
            geometries.append((title, faces))
            points.append(own)
            corners.append(triangles + np.uint32(vertices))
            vertices, faces = vertices + len(own), faces + len(triangles)
        bits = None
        if masks is not None:
            bits = np.repeat(_arrays.masks(masks, len(named), "meshes"), [len(part) for part in corners[1:]])
        scene = cls.__new__(cls)
        scene._make(np.concatenate(points), np.concatenate(corners), name, builder, invalid, geometries, bits)
        return scene

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, builder: str | None = None, invalid: str = "raise") -> Scene:
        """The scene of a file, or a built-in one by its name: "yard", "car".

        Polygons are triangles, in the order of the file. What is worth knowing of the file is in `remarks`.

        Raises
        ------
        OSError
            When the file cannot be read.
        ValueError
            When it is no scene; the message names the line and says what to do.
        """
        scene = cls.__new__(cls)
        scene._native = _raybalance.Scene.load(os.fspath(path), builder, _drops(invalid))
        return scene

    @property
    def source(self) -> str:
        """The file it was loaded from, or its name."""
        return self._native.source

    @property
    def vertices(self) -> NDArray[Any]:
        """N × 3 coordinates, as they were given: float32, or float64 where `offset` is not 0."""
        vertices = self._native.vertices()
        return vertices + self.offset if self.offset.any() else vertices

    @property
    def faces(self) -> NDArray[np.uint32]:
        """M × 3 rows of `vertices`, one for each triangle."""
        return self._native.faces()

    @property
    def geometries(self) -> list[Geometry]:
        """What the scene is made of: the meshes that it was given, or objects, groups and nodes of its file. One, where it
        is not told apart."""
        return [Geometry(*each) for each in self._native.geometries]

    @property
    def offset(self) -> NDArray[np.float64]:
        """What was subtracted from coordinates, so that single precision holds them: 3 numbers, 0 mostly."""
        return np.array(self._native.offset)

    @property
    def bounds(self) -> NDArray[np.float64] | None:
        """2 × 3: the smallest and the largest corner. None without triangles."""
        bounds = self._native.bounds
        return None if bounds is None else np.array(bounds)

    @property
    def load_s(self) -> float:
        """Seconds that loading took, and looking through the triangles."""
        return self._native.seconds[0]

    @property
    def build_s(self) -> float:
        """Seconds that building the tree took."""
        return self._native.seconds[1]

    @property
    def remarks(self) -> list[str]:
        """What is worth knowing of the file, a sentence each: statements that were passed over, doubtful numbers."""
        warnings, notes = self._native.remarks
        return [*warnings, *notes]

    def __len__(self) -> int:
        """Number of triangles."""
        return self._native.triangles

    def camera(self, width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Origins and directions of a view of the whole scene, a ray through the middle of each pixel.

        Returns
        -------
        Two arrays, height·width × 3, row by row from the upper left. The component of a direction along the view is 1,
        so that `t` is the depth.
        """
        if not (0 < width < 65536 and 0 < height < 65536):
            raise ValueError(f"width, height: {width} × {height}; both must be from 1 to 65535")
        return self._native.camera(width, height)

    def __repr__(self) -> str:
        return f"<raybalance.Scene {self.source}: {len(self):,} triangles>"


def _drops(invalid: str) -> bool:
    if invalid not in ("raise", "drop"):
        raise ValueError(f"invalid: {invalid!r} is neither 'raise' nor 'drop'")
    return invalid == "drop"


def _check_finite(points: NDArray[Any], corners: NDArray[np.uint32]) -> None:
    """Refuses triangles that are not finite, in the arrays' own words. Vertices that no face uses may be anything."""
    with np.errstate(over="ignore"):
        bad = ~np.isfinite(points.astype(np.float32, copy=False)).all(axis=1)
    if bad.any():
        used = bad[corners].any(axis=1)
        if used.any():
            face = int(np.argmax(used))
            vertex = next(int(corner) for corner in corners[face] if bad[corner])
            raise ValueError(
                f"vertices: row {vertex}, a corner of face {face}, is NaN or beyond single precision "
                f"({int(used.sum())} such faces in all): mend the mesh, or leave such faces out by invalid='drop'"
            )
