"""Tracers: a scene on devices, and what was learnt about them."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _raybalance
from ._run import Run
from ._scene import Scene

_QUEUES, _POLICIES, _ESTIMATORS = _raybalance.catalogue()


class Tracer:
    """A scene on devices, ready to trace rays.

    Keep it: it learns. From every run it takes what tests cost on each device and what such rays cost in this scene, so
    that later runs are balanced better. One thread traces at a time, a second one waits. Ctrl-C ends a run at once, and
    the tracer is as good as before.

    Parameters
    ----------
    scene
        What rays are traced through.
    devices
        A list such as "cpu:2,cpu:1@0.5,vulkan:0" (threads; speed, to try things out; number of the graphics card), or
        the same as a sequence of strings. "auto": a device for each core, and every graphics card.
    queue
        How devices get their tasks: "hybrid", "static", "central".
    policy
        How tasks are dealt, or ordered: "lpt" (None, too), "block", "round-robin".
    estimator
        How the cost of tasks is estimated: "auto", "uniform", "exact", "history" and others, with the share of the
        rays that is walked behind a blank where that is wanted: "exact 1/64".
    precision
        How triangles are tested: "robust" and "f64" are exact, "fast" may leak. None: as the scene needs it.
    task_size
        Rays per task: what is dealt to devices is so many rays that follow each other.
    seed
        Of the estimator's samples.

    Raises
    ------
    ValueError
        When an argument names nothing; the message lists what there is.
    DeviceError
        When a device cannot be used, or cannot take the scene.
    """

    def __init__(
        self,
        scene: Scene,
        devices: str | Sequence[str] = "auto",
        *,
        queue: str = "hybrid",
        policy: str | None = None,
        estimator: str = "auto",
        precision: str | None = None,
        task_size: int = 1024,
        seed: int = 1,
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: a raybalance.Scene is needed, not {type(scene).__name__}")
        listed = devices if isinstance(devices, str) else ",".join(devices)
        if not 1 <= task_size < 2**32:
            raise ValueError(f"task_size: {task_size} is not from 1 to 2**32 - 1")
        if not 0 <= seed < 2**32:
            raise ValueError(f"seed: {seed} is not from 0 to 2**32 - 1")
        self._scene = scene
        self._settings = (queue, policy, estimator)
        self._native = _raybalance.Tracer(
            scene._native, listed, queue, policy, estimator, precision, task_size, seed
        )

    @property
    def scene(self) -> Scene:
        """What rays are traced through."""
        return self._scene

    @property
    def devices(self) -> list[str]:
        """Names of the devices, in the order of the list."""
        return self._native.devices

    def run(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        query: str = "closest",
        max_hits: int = 16,
        mask: int = 0xFFFFFFFF,
        counts: bool = False,
        coherent: bool | None = None,
        invalid: str = "raise",
    ) -> Run:
        """Traces rays: points `origin + t · direction` with `tmin ≤ t ≤ tmax`.

        Parameters
        ----------
        origins, directions
            N × 3 each, in the scene's coordinates. One row of either serves all rays of the other. Directions need not
            have unit length: `t` counts in their lengths. Contiguous float32 is read where it is; origins in float64
            keep their digits where the scene has an `offset`.
        tmin, tmax
            One number for all rays, or N.
        query
            "closest": the nearest hit, ties to the lowest id. "any": some hit, if there is one. "all": every hit in order
            of distance, ties in order of ids, up to `max_hits` of each ray; arrays of hits have so many places for each.
        max_hits
            Of `query="all"`. A ray whose last place is a hit may have more.
        mask
            32 bits: faces whose mask (`Scene(…, masks=…)`) has none of them are passed by. Processors trace such rays, and
            those of "all"; graphics cards are left out.
        counts
            Whether to count box and triangle tests of each ray.
        coherent
            Whether rays that follow each other take similar paths, as neighbours of a picture do; None: not known. It
            changes no hit, only speed.
        invalid
            What to do with rays that have NaN or infinite origins or directions, or NaN limits: "raise", or "miss".
            Directions of length 0, and `tmin > tmax`, miss in any case.

        Raises
        ------
        ValueError, TypeError
            When an array cannot be taken; the message names it and says what to do.
        DeviceError
            When every device failed.
        KeyboardInterrupt
            After Ctrl-C.
        """
        if query not in ("closest", "any", "all"):
            raise ValueError(f"query: {query!r} is none of 'closest', 'any', 'all'")
        if not 1 <= max_hits < 2**32:
            raise ValueError(f"max_hits: {max_hits} is not from 1 to 2**32 - 1")
        if not 0 <= mask < 2**32:
            raise ValueError(f"mask: {mask} is not from 0 to 2**32 - 1")
        if invalid not in ("raise", "miss"):
            raise ValueError(f"invalid: {invalid!r} is neither 'raise' nor 'miss'")
        starts = _arrays.points("origins", origins)
        ways = _arrays.single(_arrays.points("directions", directions))
        starts, ways = _paired(starts, ways)
        rays = len(starts)
        if rays >= 2**32:
            raise ValueError(f"origins: {rays} rays are more than 2**32 - 1: trace them in parts")
        try:
            native = self._native.run(
                starts,
                ways,
                _arrays.limit("tmin", tmin, rays),
                _arrays.limit("tmax", tmax, rays),
                query,
                max_hits,
                mask,
                counts,
                coherent,
                invalid == "miss",
            )
        except ValueError as error:
            if len(error.args) == 2:
                raise ValueError(_invalid(starts, ways, *error.args)) from None
            raise
        return Run(native, self._scene, max_hits if query == "all" else None)

    def compare(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        queues: Sequence[str] = _QUEUES,
        policies: Sequence[str | None] = (None,),
        estimators: Sequence[str] = ("uniform", "auto"),
        repeats: int = 3,
        **ray_options: Any,
    ) -> list[dict[str, Any]]:
        """Traces the same rays by every queue, policy and estimator, and tells how long that took.

        They take turns, `repeats` times each after a first round that counts for nothing, in which devices and
        estimators learn. The tracer goes on as it was made, and its estimator begins anew.

        Returns
        -------
        A row for each combination, the fastest first: a list of dictionaries, which `pandas.DataFrame` takes. All
        times are medians in seconds: `makespan_s` from before the estimation until the last hit, `estimate_s` the
        estimation's part of it; `imbalance` is how much longer it took than if all devices had been busy to the end.
        """
        if repeats < 1:
            raise ValueError(f"repeats: {repeats} is not at least 1")
        combinations = [
            (queue, policy, estimator)
            for queue in queues
            for policy in policies
            for estimator in estimators
        ]
        reports: dict[tuple[str, str | None, str], list[dict[str, Any]]] = {each: [] for each in combinations}
        try:
            for turn in range(repeats + 1):
                for each in combinations:
                    self._native.schedule(*each)
                    report = self.run(origins, directions, **ray_options).report
                    if turn > 0:
                        reports[each].append(report)
        finally:
            self._native.schedule(*self._settings)
        rows = []
        for (queue, _, estimator), measured in reports.items():
            streams = [report["streams"][0] for report in measured]
            imbalances = [stream["imbalance"] for stream in streams if stream["imbalance"] is not None]
            rows.append(
                {
                    "queue": queue,
                    "policy": measured[0]["policy"],
                    "estimator": estimator,
                    "makespan_s": statistics.median(stream["makespan_s"] for stream in streams),
                    "estimate_s": statistics.median(stream["estimate"]["seconds"] for stream in streams),
                    "imbalance": statistics.median(imbalances) if imbalances else None,
                }
            )
        return sorted(rows, key=lambda row: row["makespan_s"])

    def __repr__(self) -> str:
        return f"<raybalance.Tracer of {self._scene.source} on {', '.join(self.devices)}>"


def _paired(starts: NDArray[Any], ways: NDArray[np.float32]) -> tuple[NDArray[Any], NDArray[np.float32]]:
    """As many of both: one serves all."""
    if len(starts) == len(ways):
        return starts, ways
    if len(starts) == 1:
        return np.repeat(starts, len(ways), axis=0), ways
    if len(ways) == 1:
        return starts, np.repeat(ways, len(starts), axis=0)
    raise ValueError(f"directions: {len(ways)} rows, but origins have {len(starts)}: give as many, or one for all")


def _invalid(starts: NDArray[Any], ways: NDArray[np.float32], first: int, count: int) -> str:
    """What is wrong with ray `first`."""
    name = "tmin, tmax"
    with np.errstate(over="ignore"):
        for argument, array in (("origins", starts.astype(np.float32, copy=False)), ("directions", ways)):
            if not np.isfinite(array[first]).all():
                name = argument
                break
    return (
        f"{name}: row {first} is NaN or infinite ({count} such rays in all): mend them, or have them miss by "
        f"invalid='miss'"
    )
