"""The intersector on what trimesh's own tests try, and on closed meshes, where it must not miss."""

import copy
import pickle

import numpy as np
import pytest
import trimesh

from raybalance.trimesh import RayMeshIntersector


def with_ray(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.ray = RayMeshIntersector(mesh)
    return mesh


@pytest.fixture
def box() -> trimesh.Trimesh:
    return with_ray(trimesh.creation.box())


@pytest.fixture
def ball() -> trimesh.Trimesh:
    return with_ray(trimesh.creation.icosphere(subdivisions=3))


def test_rays_through_a_box(box) -> None:
    origins = np.tile([[0.1, 0.2, -5.0]], (3, 1)) + [[0, 0, 0], [2, 0, 0], [-0.3, 0, 0]]
    directions = np.tile([[0, 0, 1.0]], (3, 1))
    locations, index_ray, index_tri = box.ray.intersects_location(origins, directions)
    assert sorted(index_ray.tolist()) == [0, 0, 2, 2]
    assert np.allclose(np.abs(locations[:, 2]), 0.5, atol=1e-12)
    assert np.allclose(locations[:, :2], origins[index_ray, :2], atol=1e-12)
    assert (np.abs(box.face_normals[index_tri][:, 2]) == 1).all()
    assert box.ray.intersects_any(origins, directions).tolist() == [True, False, True]
    first = box.ray.intersects_first(origins, directions)
    assert first[1] == -1 and np.allclose(box.triangles_center[first[[0, 2]]][:, 2], -0.5)
    locations, index_ray, _ = box.ray.intersects_location(origins, directions, multiple_hits=False)
    assert index_ray.tolist() == [0, 2] and np.allclose(locations[:, 2], -0.5)


def test_on_vertices_and_edges(box) -> None:
    """Mutant: a tracer that leaks between triangles."""
    for points in (box.vertices, box.vertices[box.edges].mean(axis=1), box.triangles_center):
        outward = np.asarray(points) * 3
        assert box.ray.intersects_any(outward, -outward).all()
        # From the centre outwards: everything is behind a surface.
        centre = np.zeros_like(outward)
        hit = box.ray.intersects_first(centre, outward)
        assert (hit != -1).all()
        locations, index_ray, _ = box.ray.intersects_location(centre, outward, multiple_hits=False)
        assert np.allclose(locations, np.asarray(points)[index_ray], atol=1e-12)


def test_contains(ball, box) -> None:
    assert box.ray.contains_points([[0, 0, 0], [0, 0, 5.0], [0.49, 0.49, 0.49], [0.51, 0, 0]]).tolist() == [
        True,
        False,
        True,
        False,
    ]
    random = np.random.default_rng(3)
    points = random.uniform(-1.1, 1.1, size=(2000, 3))
    far = np.linalg.norm(points, axis=1)
    clear = (far < 0.97) | (far > 1.0)
    assert np.array_equal(ball.ray.contains_points(points[clear]), far[clear] < 0.97)
    # The way that trimesh's own users go.
    assert np.array_equal(ball.contains(points[clear]), far[clear] < 0.97)


def test_contains_in_cavities() -> None:
    shell = trimesh.creation.annulus(r_min=0.5, r_max=1.0, height=1.0, sections=64)
    assert with_ray(shell).ray.contains_points([[0, 0, 0], [0.75, 0, 0.1], [0, 0, 3]]).tolist() == [False, True, False]


def test_every_ray_crosses_a_closed_mesh_evenly(ball) -> None:
    """Mutants: a hit that is found again behind itself; a limit that skips what lies just behind a hit."""
    random = np.random.default_rng(4)
    origins = random.normal(size=(3000, 3))
    origins *= 4 / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = random.uniform(-0.7, 0.7, size=(3000, 3))
    index_tri, index_ray = ball.ray.intersects_id(origins, targets - origins)
    hits = np.bincount(index_ray, minlength=3000)
    inside = np.linalg.norm(targets, axis=1) < 0.95
    assert (hits[inside] == 2).all() and (hits % 2 == 0).mean() > 0.999
    pairs = np.stack([index_ray, index_tri], axis=1)
    assert len(np.unique(pairs, axis=0)) == len(pairs)


def test_hits_follow_each_other_and_are_limited() -> None:
    planes = trimesh.util.concatenate(
        [trimesh.Trimesh([[-9, -9, z], [9, -9, z], [0, 9, z]], [[0, 1, 2]]) for z in range(10)]
    )
    with_ray(planes)
    index_tri, index_ray = planes.ray.intersects_id([[0, 0, -1.0]], [[0, 0, 1.0]])
    assert index_tri.tolist() == list(range(10)) and not index_ray.any()
    assert planes.ray.intersects_id([[0, 0, -1.0]], [[0, 0, 1.0]], max_hits=3)[0].tolist() == [0, 1, 2]
    assert planes.ray.intersects_id([[0, 0, -1.0]], [[0, 0, 1.0]], multiple_hits=False)[0].tolist() == [0]


def test_no_rays_and_bad_rays(box) -> None:
    index_tri, index_ray, locations = box.ray.intersects_id([], [], return_locations=True)
    assert len(index_tri) == len(index_ray) == 0 and locations.shape == (0, 3)
    bad = [[np.nan, 0, 0], [0, 0, 2.0]]
    assert box.ray.intersects_first(bad, [[0, 0, -1.0], [0, 0, 0.0]]).tolist() == [-1, -1]
    with pytest.raises(ValueError, match="ray_directions"):
        box.ray.intersects_any([[0, 0, 0]], [[0, 0, 1], [0, 0, 1]])


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_sizes_change_nothing(scale) -> None:
    mesh = with_ray(trimesh.creation.box(extents=[scale] * 3))
    locations, index_ray, _ = mesh.ray.intersects_location([[0.1 * scale, 0, 3 * scale]], [[0, 0, -1.0]])
    assert len(index_ray) == 2 and np.allclose(np.abs(locations[:, 2]), scale / 2, rtol=1e-12)


def test_a_mesh_that_changes_is_traced_as_it_is(box) -> None:
    """Mutant: the tree kept."""
    ray = ([[0, 0, 5.0]], [[0, 0, -1.0]])
    assert np.allclose(box.ray.intersects_location(*ray, multiple_hits=False)[0][0, 2], 0.5)
    box.apply_translation([0, 0, 1])
    assert np.allclose(box.ray.intersects_location(*ray, multiple_hits=False)[0][0, 2], 1.5)


def test_copies_work(box) -> None:
    ray = ([[0.1, 0.2, 5.0]], [[0, 0, -1.0]])
    want = box.ray.intersects_first(*ray)
    for other in (copy.copy(box.ray), copy.deepcopy(box.ray), pickle.loads(pickle.dumps(box.ray))):
        assert np.array_equal(other.intersects_first(*ray), want)
