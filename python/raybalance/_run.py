"""What a run brought: hits, and how the work was balanced."""

from __future__ import annotations

import json
import os
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _raybalance
from ._scene import Scene

_TASK = np.dtype(
    [
        ("first", np.uint32),
        ("rays", np.uint32),
        ("estimated_tests", np.float64),
        ("predicted_s", np.float64),
        ("measured_s", np.float64),
        ("device", np.uint32),
    ]
)


class Report(dict[str, Any]):
    """The numbers of a run: a dictionary with what `report.json` holds."""

    def __init__(self, native: _raybalance.Run) -> None:
        super().__init__(json.loads(native.report()))
        self._native = native

    def save(self, path: str | os.PathLike[str], shape: tuple[int, int] | None = None) -> None:
        """Writes a page (`.html`: charts, tables, and a cost map where `shape` is the picture's (height, width)) or
        the numbers (`.json`), as a whole or not at all. Missing folders are made.

        Raises
        ------
        ValueError
            When the name ends otherwise, or the shape does not fit the rays.
        OSError
            When the file cannot be written.
        """
        text = os.fspath(path)
        ending = os.path.splitext(text)[1].lower()
        if ending == ".json":
            self._native.write_json(text)
        elif ending == ".html":
            size = None
            if shape is not None:
                height, width = _picture(shape, self["streams"][0]["rays"])
                size = [width, height]
            self._native.write_html(text, size)
        else:
            raise ValueError(f"path: `{text}` must end in .html (a page) or .json (the numbers)")


class Run:
    """What tracing N rays brought.

    Arrays are in the order of the rays. `t`, `u`, `v` and `prim_id` are columns of one array; nothing is copied for
    them. Where all hits were asked for, up to K of each ray, these arrays, `hit`, `geom_id` and `normal` have K places
    for each ray, N × K: its hits in order of distance, then misses.
    """

    def __init__(self, native: _raybalance.Run, scene: Scene, places: int | None = None) -> None:
        self._native = native
        self._scene = scene
        hits: NDArray[np.float32] = native.take_hits()
        self._hits = hits if places is None else hits.reshape(-1, places, 4)
        self._counts: NDArray[np.uint32] | None = native.take_counts()

    def __len__(self) -> int:
        """Number of rays."""
        return len(self._hits)

    @property
    def t(self) -> NDArray[np.float32]:
        """N distances in lengths of the rays' directions; infinite for a miss."""
        return self._hits[..., 0]

    @property
    def u(self) -> NDArray[np.float32]:
        """N barycentric weights of the second vertex; 0 for a miss."""
        return self._hits[..., 1]

    @property
    def v(self) -> NDArray[np.float32]:
        """N barycentric weights of the third vertex; 0 for a miss."""
        return self._hits[..., 2]

    @property
    def prim_id(self) -> NDArray[np.int32]:
        """N rows of the scene's faces; −1 for a miss."""
        return self._hits[..., 3].view(np.int32)

    @cached_property
    def geom_id(self) -> NDArray[np.int32]:
        """N positions in the scene's `geometries`; −1 for a miss."""
        firsts = np.array([geometry.first for geometry in self._scene.geometries], dtype=np.int64)
        return (np.searchsorted(firsts, self.prim_id, side="right") - 1).astype(np.int32)

    @property
    def hit(self) -> NDArray[np.bool_]:
        """N truth values: whether a ray hit anything."""
        return self.prim_id != -1

    @cached_property
    def normal(self) -> NDArray[np.float32]:
        """N × 3 unit normals of the triangles that were hit, by the right-hand rule; 0 for a miss."""
        ids = self.prim_id
        return self._scene._native.normals(ids.reshape(-1)).reshape(*ids.shape, 3)

    @property
    def counts(self) -> NDArray[np.uint32] | None:
        """N × 2 box and triangle tests, the same on every device; None unless `run` was asked for them."""
        return self._counts

    @cached_property
    def tasks(self) -> NDArray[np.void]:
        """A record for each task: `first` ray, number of `rays`, `estimated_tests` (boxes and triangles),
        `predicted_s` and `measured_s` (seconds on the device that traced it, NaN where unknown), `device` (position in
        the tracer's `devices`)."""
        columns = self._native.tasks()
        tasks = np.empty(len(columns[0]), dtype=_TASK)
        for name, column in zip(_TASK.names or (), columns, strict=True):
            tasks[name] = column
        return tasks

    @cached_property
    def report(self) -> Report:
        """The numbers of the run, as `report.json` has them; `.save("run.html")` makes a page of them."""
        return Report(self._native)

    def cost_map(self, shape: tuple[int, int], of: str = "measured") -> NDArray[np.float32]:
        """What every ray of a picture cost.

        Parameters
        ----------
        shape
            Height and width; the rays are its pixels, row by row.
        of
            "measured" or "predicted": seconds per ray of each ray's task. "estimated": tests per ray of its task.
            "counts": tests of the ray itself, which `run` must have counted.
        """
        height, width = _picture(shape, len(self))
        if of == "counts":
            if self._counts is None:
                raise ValueError("of: tests were not counted; trace with counts=True")
            return self._counts.sum(axis=1, dtype=np.float32).reshape(height, width)
        names = {"measured": "measured_s", "predicted": "predicted_s", "estimated": "estimated_tests"}
        if of not in names:
            raise ValueError(f"of: {of!r} is none of {', '.join(map(repr, names))}, 'counts'")
        tasks = self.tasks
        costs = (tasks[names[of]] / tasks["rays"]).astype(np.float32)
        return np.repeat(costs, tasks["rays"]).reshape(height, width)

    def __repr__(self) -> str:
        return f"<raybalance.Run of {len(self):,} rays: {int(self.hit.sum()):,} hits>"


def _picture(shape: tuple[int, int], rays: int) -> tuple[int, int]:
    height, width = shape
    if height * width != rays or not (0 < height < 65536 and 0 < width < 65536):
        raise ValueError(f"shape: ({height}, {width}) is {height * width} pixels, but there are {rays} rays")
    return height, width
