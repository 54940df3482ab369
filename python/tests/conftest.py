"""What the tests share: meshes, and a tracer of all kinds of CPU devices."""

import numpy as np
import pytest

import raybalance

# Mutants are named where a test exists for one, as in the Rust tests.


def sphere(rings: int = 16, segments: int = 32) -> tuple[np.ndarray, np.ndarray]:
    """A closed mesh around the origin, of radius 1: outside by the right-hand rule."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    ring = np.stack(
        [np.outer(np.sin(theta), np.cos(phi)), np.outer(np.sin(theta), np.sin(phi)), np.outer(np.cos(theta), phi * 0 + 1)],
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.concatenate([[[0.0, 0.0, 1.0]], ring, [[0.0, 0.0, -1.0]]])
    faces = []
    last = len(vertices) - 1
    for s in range(segments):
        t = (s + 1) % segments
        faces.append((0, 1 + s, 1 + t))
        faces.append((last, last - segments + t, last - segments + s))
        for r in range(rings - 2):
            a, b = 1 + r * segments, 1 + (r + 1) * segments
            faces += [(a + s, b + s, b + t), (a + s, b + t, a + t)]
    return vertices.astype(np.float32), np.array(faces)


@pytest.fixture(scope="session")
def ball() -> raybalance.Scene:
    return raybalance.Scene(*sphere())


@pytest.fixture(scope="session")
def tracer(ball: raybalance.Scene) -> raybalance.Tracer:
    return raybalance.Tracer(ball, devices="cpu:1,cpu:1")


@pytest.fixture
def rays() -> tuple[np.ndarray, np.ndarray]:
    """From all around towards points near the origin; some miss."""
    random = np.random.default_rng(1)
    origins = random.normal(size=(5000, 3))
    origins *= 3 / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = random.uniform(-1.2, 1.2, size=(5000, 3))
    return origins.astype(np.float32), (targets - origins).astype(np.float32)
