"""Scenes: which arrays and files are taken, and what is said of others."""

from pathlib import Path

import numpy as np
import pytest

import raybalance
from conftest import sphere

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)


def test_it_is_the_installed_package() -> None:
    """Mutant: the tests import the folder of the sources."""
    assert "site-packages" in raybalance.__file__


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.float16, np.int32])
@pytest.mark.parametrize("layout", [np.ascontiguousarray, np.asfortranarray, lambda a: np.repeat(a, 2, axis=0)[::2]])
def test_any_array_of_numbers_is_a_mesh(dtype, layout) -> None:
    scene = raybalance.Scene(layout(TRIANGLE.astype(dtype)), layout(np.array([[0, 1, 2]], dtype=np.int16)))
    assert len(scene) == 1
    assert np.array_equal(scene.vertices, TRIANGLE)
    assert np.array_equal(scene.faces, [[0, 1, 2]])
    assert np.array_equal(scene.bounds, [[0, 0, 0], [1, 1, 0]])


def test_lists_are_a_mesh_and_none_is_empty() -> None:
    assert len(raybalance.Scene(TRIANGLE.tolist(), [[0, 1, 2]])) == 1
    empty = raybalance.Scene([], [])
    assert len(empty) == 0 and empty.bounds is None
    assert not raybalance.Tracer(empty, "cpu:1").run([[0, 0, 0]], [[0, 0, 1]]).hit.any()


@pytest.mark.parametrize(
    ("vertices", "faces", "error", "words"),
    [
        (np.array([[0, 0, 0], None], dtype=object), [[0, 1, 2]], TypeError, ["vertices", "tolist"]),
        (TRIANGLE[:, :2], [[0, 1, 2]], ValueError, ["vertices", "(3, 2)", "(N, 3)"]),
        (TRIANGLE.ravel(), [[0, 1, 2]], ValueError, ["vertices.reshape(-1, 3)"]),
        (np.zeros((3, 7)), [[0, 1, 2]], ValueError, ["vertices.T"]),
        (TRIANGLE + 1j, [[0, 1, 2]], TypeError, ["vertices", "complex"]),
        (TRIANGLE > 0, [[0, 1, 2]], TypeError, ["vertices", "truth values"]),
        (TRIANGLE.astype(str), [[0, 1, 2]], TypeError, ["vertices", "numbers are needed"]),
        (TRIANGLE, [[0, 1, 3]], ValueError, ["faces", "row 0", "vertex 3", "0 to 2"]),
        (TRIANGLE, [[0, 1, -1]], ValueError, ["faces", "vertex -1"]),
        (TRIANGLE, [[1, 2, 3]], ValueError, ["faces - 1"]),
        (TRIANGLE, [[0, 1, 2**32]], ValueError, ["faces", str(2**32)]),
        (TRIANGLE, [[0.0, 1.0, 2.0]], TypeError, ["faces.astype(np.uint32)"]),
        (TRIANGLE, [[0, 1, 2, 0]], ValueError, ["faces", "polygons"]),
        (TRIANGLE, [0, 1, 2], ValueError, ["faces.reshape(-1, 3)"]),
        (TRIANGLE * [[1], [np.nan], [1]], [[0, 2, 1]], ValueError, ["vertices", "row 1", "face 0", "invalid='drop'"]),
        (TRIANGLE.astype(np.float64) * 1e39, [[0, 1, 2]], ValueError, ["vertices", "beyond single precision"]),
        ([[0, 0, 0], [1, 0]], [[0, 1, 2]], ValueError, ["vertices", "equal length"]),
    ],
)
def test_what_is_no_mesh_is_refused_by_name(vertices, faces, error, words) -> None:
    with pytest.raises(error) as raised:
        raybalance.Scene(vertices, faces)
    assert all(word in str(raised.value) for word in words), raised.value


def test_faces_that_are_no_numbers_can_be_dropped() -> None:
    vertices = np.vstack([TRIANGLE, [[np.nan] * 3]])
    scene = raybalance.Scene(vertices, [[0, 1, 3], [0, 1, 2]], invalid="drop")
    run = raybalance.Tracer(scene, "cpu:1").run([[0.2, 0.2, 1]], [[0, 0, -1]])
    assert run.prim_id.tolist() == [1]
    # A vertex that no face uses may be anything.
    assert len(raybalance.Scene(vertices, [[0, 1, 2]])) == 1


def test_meshes_are_geometries_with_masks() -> None:
    """Mutants: faces of the second mesh on vertices of the first; the number of a face for that of a mesh; masks of meshes
    for those of faces."""
    low = (TRIANGLE, [[0, 1, 2]] * 2)
    high = (TRIANGLE.astype(np.float64) + [0, 0, 1], [[0, 1, 2]])
    scene = raybalance.Scene.of_meshes({"low": low, "none": (TRIANGLE, []), "high": high}, masks=[1, 1, 2])
    assert scene.geometries == [("low", 0, 2), ("none", 2, 0), ("high", 2, 1)]
    assert scene.geometries[2].name == "high" and len(scene) == 3
    tracer = raybalance.Tracer(scene, "cpu:1")
    down = ([[0.2, 0.2, 2], [5, 5, 2]], [[0, 0, -1]])
    run = tracer.run(*down)
    assert run.geom_id.tolist() == [2, -1] and run.geom_id.dtype == np.int32 and run.prim_id.tolist() == [2, -1]
    assert tracer.run(*down, mask=1).t.tolist() == [2, np.inf]
    assert not tracer.run(*down, mask=4).hit.any()
    several = tracer.run(*down, query="all", max_hits=4, mask=3)
    assert several.geom_id.tolist() == [[2, 0, 0, -1], [-1] * 4]
    faces = raybalance.Scene(TRIANGLE, [[0, 1, 2]] * 2, masks=[1, 2])
    assert raybalance.Tracer(faces, "cpu:1").run([[0.2, 0.2, 2]], [[0, 0, -1]], mask=2).prim_id.tolist() == [1]
    assert faces.geometries == [("", 0, 2)]
    unnamed = raybalance.Scene.of_meshes([low, high])
    assert [geometry.name for geometry in unnamed.geometries] == ["", ""]
    for wrong, words in [
        (lambda: raybalance.Scene.of_meshes({"low": (TRIANGLE, [[0, 1, 3]])}), ["meshes['low']", "faces", "vertex 3"]),
        (lambda: raybalance.Scene.of_meshes([low, (TRIANGLE,)]), ["meshes[1]", "vertices and faces"]),
        (lambda: raybalance.Scene.of_meshes([low, high], masks=[1]), ["masks", "2 meshes"]),
        (lambda: raybalance.Scene(*low, masks=[1, 2, 3]), ["masks", "2 faces"]),
        (lambda: raybalance.Scene(*low, masks=[1, 2**32]), ["masks", "2**32 - 1"]),
        (lambda: raybalance.Scene(*low, masks=[0.5, 1]), ["masks", "integers"]),
    ]:
        with pytest.raises((TypeError, ValueError)) as raised:
            wrong()
        assert all(word in str(raised.value) for word in words), raised.value


def test_objects_of_a_file_are_geometries(tmp_path: Path) -> None:
    obj = tmp_path / "two.obj"
    obj.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\no left\nf 1 2 3\no right\nf 1 2 3\nf 1 3 2\n")
    assert raybalance.Scene.load(obj).geometries == [("left", 0, 1), ("right", 1, 2)]


def test_far_from_the_origin_double_precision_keeps_its_digits() -> None:
    """Mutants: the offset left out of the origins, or subtracted after they are rounded."""
    far = np.array([4e6, -3e6, 2e6])
    scene = raybalance.Scene(TRIANGLE.astype(np.float64) * 0.1 + far, [[0, 1, 2]])
    assert scene.offset.any()
    assert np.allclose(scene.vertices, TRIANGLE * 0.1 + far, rtol=0, atol=1e-8)
    assert np.allclose(scene.bounds[1], far + [0.1, 0.1, 0], rtol=0, atol=1e-8)
    run = raybalance.Tracer(scene, "cpu:1").run([far + [0.02, 0.03, 0.25]], [[0, 0, -1]])
    assert run.hit.all() and abs(run.t[0] - 0.25) < 1e-6
    assert abs(run.u[0] - 0.2) < 1e-5 and abs(run.v[0] - 0.3) < 1e-5


def test_files_and_built_in_scenes(tmp_path: Path) -> None:
    obj = tmp_path / "one.obj"
    obj.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert len(raybalance.Scene.load(obj)) == 1
    assert raybalance.Scene.load(str(obj)).source == str(obj)
    obj.write_text("v 0 0 0\nf 1 2 3\n")
    with pytest.raises(ValueError, match="one.obj:2"):
        raybalance.Scene.load(obj)
    with pytest.raises(OSError, match="none.obj"):
        raybalance.Scene.load(tmp_path / "none.obj")
    with pytest.raises(ValueError, match="built-in are: .*yard"):
        raybalance.Scene.load("no such scene")


def test_arguments_that_name_nothing() -> None:
    with pytest.raises(ValueError, match="builder"):
        raybalance.Scene(*sphere(), builder="fast")
    with pytest.raises(ValueError, match="invalid"):
        raybalance.Scene(*sphere(), invalid="keep")


def test_a_camera_sees_the_scene(ball: raybalance.Scene) -> None:
    origins, directions = ball.camera(32, 24)
    assert origins.shape == directions.shape == (32 * 24, 3)
    hit = raybalance.Tracer(ball, "cpu:1").run(origins, directions).hit.reshape(24, 32)
    assert hit[12, 16] and not hit[0, 0]
    with pytest.raises(ValueError, match="width, height"):
        ball.camera(0, 5)
