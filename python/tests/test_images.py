"""Image sources of boxes and polygons."""

import numpy as np
import pytest

import sonard

SIZE = (4.0, 3.0, 2.5)
SOURCE = (1.0, 0.7, 1.1)
RECEIVERS = [(2.9, 2.1, 1.7), (1.3, 2.2, 0.4)]


def test_box_is_the_lattice() -> None:
    found = sonard.image_sources(SIZE, SOURCE, RECEIVERS, 3, reflectance=0.9, sound_speed_m_s=340.0)
    # Octahedral numbers: cells within three steps of the room.
    assert len(found) == 2 * 63
    assert np.array_equal(np.bincount(found.orders), 2 * np.array([1, 6, 18, 38]))
    apart = np.linalg.norm(found.positions_m - np.array(RECEIVERS)[found.receivers], axis=1)
    np.testing.assert_allclose(found.delays_s, apart / 340.0, rtol=1e-12)
    np.testing.assert_allclose(found.reflectances, 0.9 ** found.orders.astype(float), rtol=1e-12)
    np.testing.assert_allclose(found.amplitudes, found.reflectances / (4 * np.pi * apart), rtol=1e-12)
    assert np.array_equal((found.walls >= 0).sum(axis=1), found.orders)
    assert np.all(np.diff(found.delays_s[found.receivers == 0]) >= 0)


def test_scene_matches_box() -> None:
    corners = [[0, 0], [4, 0], [4, 3], [0, 3]]
    scene = sonard.Scene.from_points(corners, reflectance=0.8, floor_z_m=0.0, ceiling_z_m=2.5)
    traced = sonard.image_sources(scene, SOURCE, RECEIVERS, 4)
    # Floor and ceiling of such a scene are rigid.
    closed = sonard.image_sources(SIZE, SOURCE, RECEIVERS, 4, reflectance=[0.8] * 4 + [1.0] * 2)
    np.testing.assert_allclose(traced.delays_s, closed.delays_s, rtol=1e-12)
    # Images at equal distances are in any order.
    np.testing.assert_allclose(np.sort(traced.amplitudes), np.sort(closed.amplitudes), rtol=1e-12)


def test_planar_room_with_a_hidden_source() -> None:
    corners = [[0, 0], [4, 0], [4, 2], [2, 2], [2, 4], [0, 4]]
    found = sonard.image_sources(sonard.Scene.from_points(corners), [3.5, 1.5], [1.5, 3.5], 2)
    assert len(found) > 0 and found.orders.min() > 0
    assert np.all(found.positions_m[:, 2] == 0)
    assert "images up to order 2 at 1 receivers" in repr(found)


def test_errors() -> None:
    with pytest.raises(sonard.SonardError, match="must be inside the room"):
        sonard.image_sources(SIZE, (5.0, 1.0, 1.0), RECEIVERS, 1)
    with pytest.raises(sonard.SonardError, match="only flat walls"):
        sonard.image_sources(sonard.Scene.shipped("mcgill-lab"), (1.0, 1.0), (2.0, 1.0), 1)
    with pytest.raises(ValueError, match="the last axis of receivers"):
        sonard.image_sources(SIZE, SOURCE, [1.0], 1)
    with pytest.raises(ValueError, match="reflectance is for boxes"):
        sonard.image_sources(sonard.Scene.from_points([[0, 0], [1, 0], [1, 1]]), SOURCE, SOURCE, 1, reflectance=0.5)
