"""Rays traced from Python, the same in Rust, and by embreex in process: wall seconds of one call each, in turn.

    cd python && cargo build --release --target-dir ../target --example same_in_rust
    maturin build --release --target-dir ../target && pip install ../target/wheels/raybalance-*.whl embreex
    python benches/side_by_side.py ../target/release/examples/same_in_rust [SCENE] [DEVICES]

Embree runs on the calling thread alone; DEVICES is cpu:1 unless another list is given. The file that rays go to lies in
the system's folder for such files and is removed.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import raybalance

ROUNDS = 15
SIDE = 1000


def kinds(scene: raybalance.Scene) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """A million camera rays in rows, and as many from where those hit into all directions."""
    origins, directions = scene.camera(SIDE, SIDE)
    origins = origins.astype(np.float32)
    run = raybalance.Tracer(scene).run(origins, directions)
    hit = run.hit
    where = origins[hit] + directions[hit] * (run.t[hit, None] * np.float32(0.999))
    random = np.random.default_rng(5)
    starts = where[np.sort(random.integers(0, len(where), SIDE * SIDE))]
    ways = random.normal(size=starts.shape).astype(np.float32)
    return {"camera": (origins, directions), "diffuse": (starts, ways)}


def embree(scene: raybalance.Scene):
    """A function that traces by embreex; None where it is not installed."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError:
        return None
    built = EmbreeScene()
    TriangleMesh(built, scene.vertices.astype(np.float32), scene.faces.astype(np.int32))
    return built.run


def main() -> None:
    program, name = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "yard"
    devices = sys.argv[3] if len(sys.argv) > 3 else "cpu:1"
    scene = raybalance.Scene.load(name)
    by_embree = embree(scene)
    print(f"{scene}, {SIDE * SIDE:,} rays, {devices}; seconds, median (least) of {ROUNDS} in turn")
    for kind, (origins, directions) in kinds(scene).items():
        coherent = True if kind == "camera" else None
        tracer = raybalance.Tracer(scene, devices)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "rays.npy"
            zero, far = np.zeros((len(origins), 1)), np.full((len(origins), 1), np.inf)
            np.save(file, np.hstack([origins, zero, directions, far]).astype(np.float32))
            rust = subprocess.Popen(
                [program, name, file, devices, "coherent" if coherent else "unknown"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            times: dict[str, list[float]] = {"python": [], "makespan": [], "rust": [], "embreex": []}
            for turn in range(ROUNDS + 2):
                begin = time.perf_counter()
                run = tracer.run(origins, directions, coherent=coherent)
                ids = run.prim_id
                python = time.perf_counter() - begin
                rust.stdin.write("\n")
                rust.stdin.flush()
                seconds = {
                    "python": python,
                    "makespan": run.report["streams"][0]["makespan_s"],
                    "rust": float(rust.stdout.readline()),
                }
                if by_embree is not None:
                    begin = time.perf_counter()
                    theirs = by_embree(origins, directions)
                    seconds["embreex"] = time.perf_counter() - begin
                # The first two warm up.
                if turn >= 2:
                    for part, value in seconds.items():
                        times[part].append(value)
            rust.stdin.close()
            rust.wait()
        figures = ", ".join(f"{part} {np.median(all):.4f} ({min(all):.4f})" for part, all in times.items() if all)
        ratio = np.median(times["python"]) / np.median(times["rust"])
        print(f"{kind}: {figures}; python / rust {ratio:.3f}")
        if by_embree is not None:
            print(f"  python / embreex {np.median(times['python']) / np.median(times['embreex']):.3f}; "
                  f"the same id for {np.mean(ids == theirs):.4%} of the rays")


main()
