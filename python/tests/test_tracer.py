"""Runs: right hits, whatever the arrays and devices; errors that name the argument; Ctrl-C; threads and forks."""

import json
import multiprocessing
import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import raybalance


def nearest(scene, origins, directions):
    """Möller–Trumbore in double precision over all triangles: t, and the id."""
    a, b, c = (scene.vertices[scene.faces[:, i]].astype(np.float64) for i in range(3))
    ts, ids = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for i, (o, d) in enumerate(zip(origins.astype(np.float64), directions.astype(np.float64), strict=True)):
        p = np.cross(d, c - a)
        det = np.einsum("ij,ij->i", b - a, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", o - a, p) / det
            q = np.cross(o - a, b - a)
            v = (q @ d) / det
            t = np.einsum("ij,ij->i", c - a, q) / det
            good = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
        if good.any():
            t = np.where(good, t, np.inf)
            ids[i] = np.argmin(t)
            ts[i] = t[ids[i]]
    return ts, ids


def test_hits_are_those_of_a_brute_force(ball, tracer, rays) -> None:
    """Mutants: columns of the hits exchanged; ids read as floats."""
    origins, directions = (array[:500] for array in rays)
    run = tracer.run(origins, directions)
    ts, ids = nearest(ball, origins, directions)
    assert np.array_equal(run.prim_id, ids)
    assert np.allclose(run.t, ts, rtol=1e-5)
    assert np.array_equal(run.hit, ids >= 0) and 100 < run.hit.sum() < 500
    hit = run.hit
    corners = ball.vertices[ball.faces[run.prim_id[hit]]].astype(np.float64)
    u, v = (array[hit, None].astype(np.float64) for array in (run.u, run.v))
    where = corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
    assert np.allclose(where, origins[hit] + directions[hit] * run.t[hit, None], atol=1e-5)
    # Outside by the right-hand rule, so against the ray.
    assert np.allclose(np.linalg.norm(run.normal[hit], axis=1), 1, atol=1e-6)
    assert (np.einsum("ij,ij->i", run.normal[hit], directions[hit]) < 0).all()
    assert not run.normal[~hit].any() and np.isinf(run.t[~hit]).all() and (run.u[~hit] == 0).all()


def test_every_kind_of_array_gives_the_same_hits(tracer, rays) -> None:
    """Mutants: strides left out of account; one row that does not serve all."""
    origins, directions = rays
    want = tracer.run(origins, directions)
    wide = np.zeros((len(origins), 6), dtype=np.float32)
    wide[:, :3], wide[:, 3:] = origins, directions
    assert not wide[:, :3].flags.c_contiguous
    for o, d in [
        (wide[:, :3], wide[:, 3:]),
        (np.asfortranarray(origins), np.asfortranarray(directions)),
        (origins.astype(np.float64), directions.astype(np.float64)),
        (origins.tolist(), directions.tolist()),
        (origins[::-1][::-1], directions.astype(">f4")),
    ]:
        run = tracer.run(o, d)
        assert np.array_equal(run.prim_id, want.prim_id) and np.array_equal(run.t, want.t)
    one = tracer.run(origins[:1], directions)
    same = tracer.run(np.repeat(origins[:1], len(directions), axis=0), directions)
    assert np.array_equal(one.prim_id, same.prim_id) and len(one) == len(directions)
    assert len(tracer.run(origins, directions[:1])) == len(origins)
    assert len(tracer.run([], [])) == 0


def test_limits_cut_rays(tracer, rays) -> None:
    """Mutants: limits exchanged; the first limit for all rays."""
    origins, directions = rays
    far = tracer.run(origins, directions)
    hit = far.hit
    beyond = tracer.run(origins, directions, tmin=np.nextafter(far.t, np.float32(np.inf)))
    assert (beyond.t[hit] > far.t[hit]).all() and beyond.hit[hit].mean() > 0.9
    before = tracer.run(origins, directions, tmax=np.nextafter(far.t, np.float32(0)))
    assert not before.hit[hit].any()
    assert not tracer.run(origins, directions, tmin=2, tmax=1).hit.any()
    exact = tracer.run(origins, directions, tmin=far.t, tmax=far.t)
    assert np.array_equal(exact.prim_id, far.prim_id)


def test_any_hit_agrees_on_whether(tracer, rays) -> None:
    assert np.array_equal(tracer.run(*rays, query="any").hit, tracer.run(*rays).hit)


def test_all_hits_come_in_order(tracer, rays) -> None:
    """Mutants: places of one ray given to another; the nearest hit last; misses in front of hits."""
    origins, directions = rays
    run = tracer.run(*rays, query="all", max_hits=3)
    assert run.t.shape == run.prim_id.shape == run.hit.shape == (5000, 3) and len(run) == 5000
    nearest = tracer.run(*rays)
    assert np.array_equal(run.prim_id[:, 0], nearest.prim_id) and np.array_equal(run.t[:, 0], nearest.t)
    # A ball is met where a ray goes in and where it comes out, but at an edge.
    assert set(np.unique(run.hit.sum(axis=1))) <= {0, 2, 3} and (run.hit.sum(axis=1) == 2).sum() > 1000
    assert (run.t[:, 1] >= run.t[:, 0]).all() and (run.hit[:, :-1] >= run.hit[:, 1:]).all()
    beyond = tracer.run(*rays, tmin=np.nextafter(nearest.t, np.float32(np.inf)))
    alone = run.hit.sum(axis=1) == 2
    assert np.array_equal(run.prim_id[alone, 1], beyond.prim_id[alone])
    assert run.normal.shape == (5000, 3, 3) and run.geom_id.shape == (5000, 3)
    inward = np.einsum("ij,ij->i", run.normal[alone, 0], directions[alone])
    outward = np.einsum("ij,ij->i", run.normal[alone, 1], directions[alone])
    assert (inward < 0).all() and (outward > 0).all()
    assert tracer.run([], [], query="all", max_hits=5).t.shape == (0, 5)


def test_settings_change_no_hit(ball, rays) -> None:
    want = raybalance.Tracer(ball, "cpu:1").run(*rays)
    for settings in [
        {"queue": "central", "estimator": "exact 1/16"},
        {"queue": "static", "policy": "round-robin", "estimator": "uniform", "task_size": 7},
        {"precision": "f64", "estimator": "history"},
    ]:
        tracer = raybalance.Tracer(ball, ["cpu:1", "cpu:1@0.5"], **settings)
        for coherent in (None, True, False):
            run = tracer.run(*rays, coherent=coherent)
            assert np.array_equal(run.prim_id, want.prim_id) and np.array_equal(run.t, want.t)


def test_counts_are_asked_for(tracer, rays) -> None:
    assert tracer.run(*rays).counts is None
    run = tracer.run(*rays, counts=True)
    assert run.counts.shape == (len(run), 2) and run.counts.dtype == np.uint32
    assert (run.counts[run.hit] > 0).all()
    assert np.array_equal(tracer.run(*rays, counts=True).counts, run.counts)


def test_tasks_cover_the_rays(tracer, rays) -> None:
    tasks = tracer.run(*rays).tasks
    assert tasks["rays"].sum() == 5000 and np.array_equal(np.cumsum(tasks["rays"])[:-1], tasks["first"][1:])
    assert (tasks["measured_s"] > 0).all() and set(tasks["device"]) <= {0, 1}


def test_cost_maps(ball) -> None:
    """Mutants: height and width exchanged; a task's cost not divided by its rays."""
    tracer = raybalance.Tracer(ball, "cpu:1", task_size=60)
    run = tracer.run(*ball.camera(60, 20), counts=True)
    measured = run.cost_map((20, 60))
    assert measured.shape == (20, 60)
    # A task is a row.
    assert np.allclose(measured, (run.tasks["measured_s"] / 60)[:, None])
    assert np.array_equal(run.cost_map((20, 60), of="counts").ravel(), run.counts.sum(axis=1))
    assert run.cost_map((20, 60), of="estimated").min() >= 0
    with pytest.raises(ValueError, match=r"shape.*1200 rays"):
        run.cost_map((20, 61))
    with pytest.raises(ValueError, match="counts=True"):
        tracer.run(*ball.camera(60, 20)).cost_map((20, 60), of="counts")


def test_reports_are_what_commands_write(tracer, rays, tmp_path: Path) -> None:
    report = tracer.run(*rays).report
    assert report["schema"] == 2 and report["scene"]["triangles"] == len(tracer.scene)
    assert report["streams"][0]["rays"] == 5000
    assert [device["name"] for device in report["streams"][0]["devices"]] == tracer.devices
    report.save(tmp_path / "run.json")
    assert json.loads((tmp_path / "run.json").read_text()) == report
    report.save(tmp_path / "run.html", shape=(50, 100))
    page = (tmp_path / "run.html").read_text()
    assert "Cost of each task" in page and tracer.devices[0] in page
    with pytest.raises(ValueError, match=".html"):
        report.save(tmp_path / "run.txt")
    for name in ("page.html", "numbers.json"):
        with pytest.raises(OSError, match="run.json"):
            report.save(tmp_path / "run.json" / name)


def test_comparisons_are_rows(tracer, rays) -> None:
    """Mutant: the tracer goes on as the last combination had it."""
    before = tracer.run(*rays).report
    rows = tracer.compare(*rays, repeats=1)
    assert {(row["queue"], row["estimator"]) for row in rows} == {
        (queue, estimator) for queue in ("hybrid", "static", "central") for estimator in ("uniform", "auto")
    }
    assert [row["makespan_s"] for row in rows] == sorted(row["makespan_s"] for row in rows)
    after = tracer.run(*rays).report
    for report in (before, after):
        assert report["queue"] == "hybrid" and report["streams"][0]["estimate"]["estimator"] == "auto"


def test_a_tracer_learns(ball, rays) -> None:
    """Mutant: a tracer that is made anew for every run."""
    tracer = raybalance.Tracer(ball, "cpu:1,cpu:1", estimator="history")
    fractions = [tracer.run(*rays).report["streams"][0]["estimate"]["fraction"] for _ in range(2)]
    assert fractions[0] > 0 and fractions[1] == 0


ROW = [[0.0, 0.0, 3.0]]


@pytest.mark.parametrize(
    ("arguments", "options", "error", "words"),
    [
        (([[0, 0, np.nan]], ROW), {}, ValueError, ["origins", "row 0", "invalid='miss'"]),
        ((ROW * 3, [[0, 0, 1], [0, 0, np.inf], [0, 0, 1]]), {}, ValueError, ["directions", "row 1", "1 such"]),
        ((ROW, [[0, 0, 1e39]]), {}, ValueError, ["directions", "row 0"]),
        ((ROW, ROW), {"tmin": np.nan}, ValueError, ["tmin, tmax", "row 0"]),
        ((ROW * 2, ROW), {"tmax": [1, np.nan]}, ValueError, ["tmin, tmax", "row 1"]),
        ((ROW * 2, ROW * 3), {}, ValueError, ["directions", "3 rows", "2"]),
        ((np.array(ROW, dtype=object), ROW), {}, TypeError, ["origins", "tolist"]),
        ((ROW[0], ROW), {}, ValueError, ["origins.reshape(-1, 3)"]),
        ((np.zeros((2, 2, 3)), ROW), {}, ValueError, ["origins.reshape(-1, 3)"]),
        ((ROW * 2, ROW), {"tmax": [1, 2, 3]}, ValueError, ["tmax", "(3,)", "(2,)"]),
        ((ROW, ROW), {"tmin": "near"}, TypeError, ["tmin"]),
        ((ROW, ROW), {"query": "every"}, ValueError, ["query", "'closest'"]),
        ((ROW, ROW), {"query": "all", "max_hits": 0}, ValueError, ["max_hits"]),
        ((ROW, ROW), {"mask": -1}, ValueError, ["mask"]),
        ((ROW, ROW), {"invalid": "keep"}, ValueError, ["invalid"]),
    ],
)
def test_what_are_no_rays_is_refused_by_name(tracer, arguments, options, error, words) -> None:
    with pytest.raises(error) as raised:
        tracer.run(*arguments, **options)
    assert all(word in str(raised.value) for word in words), raised.value


def test_rays_that_are_no_numbers_can_miss(tracer) -> None:
    origins = [[0, 0, 3], [0, 0, np.nan], [0, 0, 3]]
    run = tracer.run(origins, [[0, 0, -1], [0, 0, -1], [0, 0, 0]], invalid="miss")
    assert run.hit.tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"devices": "cpu:0"}, ["devices", "`cpu:0`"]),
        ({"devices": "cuda:0"}, ["devices", "`cuda:0`", "cpu"]),
        ({"queue": "fifo"}, ["queue", "hybrid"]),
        ({"policy": "best"}, ["policy", "lpt"]),
        ({"estimator": "exakt"}, ["estimator", "exact"]),
        ({"precision": "double"}, ["precision", "f64"]),
        ({"task_size": 0}, ["task_size"]),
        ({"seed": -1}, ["seed"]),
    ],
)
def test_settings_that_are_none_are_refused_by_name(ball, options, words) -> None:
    with pytest.raises(ValueError) as raised:
        raybalance.Tracer(ball, **{"devices": "cpu:1", **options})
    assert all(word in str(raised.value) for word in words), raised.value
    with pytest.raises(TypeError, match="scene"):
        raybalance.Tracer("yard", devices="cpu:1")


def test_a_device_that_is_not_there_is_one_exception(ball) -> None:
    with pytest.raises(raybalance.DeviceError, match="vulkan"):
        raybalance.Tracer(ball, devices="vulkan:99")


def slow_rays(rows: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(2)
    return random.normal(size=(rows, 3)).astype(np.float32), random.normal(size=(rows, 3)).astype(np.float32)


# Seconds within which a run has ended after Ctrl-C, on however busy a machine. Left alone it takes a quarter of an hour.
SOON = 300


@pytest.fixture
def interruptible():
    """Python heeds Ctrl-C, also where these tests run behind a shell's `&`, which has it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("queue", ["hybrid", "static"])
def test_ctrl_c_ends_a_run_and_the_tracer_goes_on(ball, queue, interruptible) -> None:
    """Mutants: signals that are looked for between launches only (the static queue has one); a lock that stays."""
    tracer = raybalance.Tracer(ball, devices="cpu:1@0.001", queue=queue)
    origins, directions = slow_rays(2_000_000)
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        tracer.run(origins, directions)
    ended = time.monotonic() - start
    timer.join()
    assert ended < SOON
    assert len(raybalance.Tracer(ball, "cpu:1").run(origins[:10], directions[:10])) == 10


def test_other_threads_run_meanwhile(ball, rays) -> None:
    """Mutant: the interpreter's lock held while rays are traced, so that the other thread gets nowhere."""
    tracer = raybalance.Tracer(ball, devices="cpu:1@0.01")
    ended = threading.Event()
    seen = []

    def trace() -> None:
        tracer.run(*slow_rays(200_000))
        ended.set()

    thread = threading.Thread(target=trace)
    thread.start()
    while not ended.is_set():
        seen.append(len(seen))
        time.sleep(0.001)
    thread.join()
    assert len(seen) > 20


def test_threads_take_turns(tracer, rays) -> None:
    """Mutants: a tracer that refuses a second thread; results of one thread in the other's arrays."""
    want = tracer.run(*rays)
    found = {}

    def trace(number: int) -> None:
        part = slice(number * 1000, (number + 1) * 1000)
        found[number] = tracer.run(rays[0][part], rays[1][part]).prim_id

    threads = [threading.Thread(target=trace, args=(number,)) for number in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert np.array_equal(np.concatenate([found[number] for number in range(5)]), want.prim_id)


def in_child(tracer, queue) -> None:
    try:
        tracer.run([[0, 0, 3]], [[0, 0, -1]])
        queue.put("ran")
    except RuntimeError as error:
        queue.put(str(error))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_is_told(tracer) -> None:
    """Mutant: the check left out, so that the child waits for threads it does not have."""
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=in_child, args=(tracer, queue))
    child.start()
    message = queue.get(timeout=120)
    child.join(timeout=120)
    assert "spawn" in message and child.exitcode == 0


def test_arrays_outlive_their_run(tracer, rays) -> None:
    """Mutant: arrays that do not own their memory."""
    run = tracer.run(*rays)
    ids, copy = run.prim_id, run.prim_id.copy()
    del run
    for _ in range(3):
        tracer.run(*rays)
    assert np.array_equal(ids, copy)
