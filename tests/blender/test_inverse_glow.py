"""What groups shine on each other where they glow, against what moving their reflectances changes."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from pipeline.blender.inverse import groups, together
from pipeline.blender.inverse.evidence import Evidence, worse
from pipeline.blender.inverse.room import Room
from pipeline.blender.inverse.together import derivatives
from pipeline.core.inverse.photograph import prepared
from pipeline.core.progress import finish
from tests.blender import small_scenes

WIDTH, HEIGHT = 41, 37  # whose parts floats round down
SAMPLES = 256
STEP = 0.1  # of a reflectance's logarithm


@pytest.fixture
def evidence() -> Evidence:
    """A corner of floor and wall, one object, and a wall beside, all evenly lit by a sun; every group is grey."""
    scene = small_scenes.empty()
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (1, 1, 2), (-1, 1, 2), (1, -1, 2)]
    for name, parts in {
        "Corner": {"Floor": (0, 1, 2, 3), "Wall": (3, 2, 4, 5)},
        "Side": {"Side": (2, 1, 6, 4)},
    }.items():
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(corners, [], list(parts.values()))
        for number, part in enumerate(parts):
            mesh.materials.append(small_scenes.diffuse(part, 0.5))
            mesh.polygons[number].material_index = number
        scene.collection.objects.link(bpy.data.objects.new(name, mesh))
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.rotation_euler = (0.9, 0.0, -0.7)
    scene.collection.objects.link(sun)
    small_scenes.aim(scene, (-2.5, -4.0, 2.0), 0.7)
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    seen = prepared(np.ones((HEIGHT, WIDTH, 3)), 32, "linear", (WIDTH, HEIGHT), WIDTH)
    room = Room(scene, groups.find(scene, "materials"), seen)
    return Evidence(room, prepared(room.render(SAMPLES, 1), 32, "linear", (WIDTH, HEIGHT), WIDTH))


def test_glow_shows_what_moving_a_reflectance_changes(evidence: Evidence) -> None:
    room = evidence.room
    numbers = range(len(room.groups))
    shown = room.render(SAMPLES, 2, True)
    gains = evidence.gains(shown, numbers, SAMPLES)
    for moved in numbers:
        with room.moving(moved, "diffuse", STEP):
            changed = room.render(SAMPLES, 2, True)
        for number in numbers:
            slope = np.log(evidence.mean(changed, number) / evidence.mean(shown, number)) / STEP
            assert gains[number, moved] == pytest.approx(slope, rel=0.12, abs=0.01), (number, moved)
    assert gains[~np.eye(len(numbers), dtype=bool)].min() > 0.02  # there was light between them
    assert [item.lightgroup for item in room.scene.objects] == [""] * len(room.scene.objects)
    assert not room.scene.view_layers[0].lightgroups
    assert np.array_equal(room.render(4, 3), room.render(4, 3))


def test_derivatives_of_the_picture_are_its_changes(evidence: Evidence) -> None:
    room = evidence.room
    wanted = [(number, "diffuse") for number in range(len(room.groups))]
    found = finish(derivatives(evidence, wanted)).mean(axis=0)
    shown = room.render(SAMPLES, 2, True)
    for (moved, kind), slopes in zip(wanted, found, strict=True):
        with room.moving(moved, kind, STEP):
            changed = room.render(SAMPLES, 2, True)
        for number in range(len(room.groups)):
            slope = (evidence.mean(changed, number) - evidence.mean(shown, number)) / STEP
            assert evidence.mean(slopes, number) == pytest.approx(slope, rel=0.25, abs=0.01), (number, moved)


def test_what_no_pixel_shows_is_told_by_little_noise(evidence: Evidence, monkeypatch: pytest.MonkeyPatch) -> None:
    room = evidence.room
    side = [group.name for group in room.groups].index("Side")
    evidence.masks[side][:] = False
    even = np.any([binary_erosion(mask, iterations=2) for mask in evidence.masks], axis=0)  # no edge is near
    shown = room.render(4 * SAMPLES, 2, True)
    with room.moving(side, "diffuse", STEP):
        true = (room.render(4 * SAMPLES, 2, True) - shown) / STEP
    errors = []
    for filtered in (True, False):
        if not filtered:
            monkeypatch.setattr(together, "median_filter", lambda picture, size: picture)
        found = finish(derivatives(evidence, [(side, "diffuse")])).mean(axis=0)[0]
        errors.append(np.sqrt(np.mean((found - true)[even] ** 2)))
    assert errors[0] < 0.8 * errors[1]


def test_derivatives_grow_with_the_reflectances_they_are_of(evidence: Evidence) -> None:
    room, wanted = evidence.room, [(0, "diffuse")]
    here, there = together.sizes(room, wanted), finish(derivatives(evidence, wanted)).mean(axis=(0, 1))
    room.move(0, "diffuse", np.log([0.3, 0.5, 0.7]))
    foretold = there * (together.sizes(room, wanted) / here)[0]
    now = finish(derivatives(evidence, wanted)).mean(axis=(0, 1))
    assert evidence.mean(foretold, 0) == pytest.approx(evidence.mean(now, 0), rel=0.15)  # of light between surfaces
    assert evidence.mean(now, 0)[0] < 0.4 * evidence.mean(there, 0)[0]


def test_no_step_leads_beyond_what_a_surface_can_reflect(evidence: Evidence) -> None:
    room, wanted = evidence.room, [(0, "diffuse"), (1, "diffuse")]
    room.move(0, "diffuse", np.log([0.9, 1.9, 0.002]))  # .95 of green, and black in blue
    slopes = finish(derivatives(evidence, wanted))
    missing = np.stack([np.broadcast_to([1.0, 1.0, -1.0], evidence.photograph.shape)] * 2)
    (by, _), *_ = together.step(evidence, wanted, slopes, missing, 0.01)
    assert by == pytest.approx([together.LONGEST, np.log(0.98 / 0.95), 0.0], abs=1e-6)


def test_where_a_reflection_is_told_more_samples_are_taken(evidence: Evidence) -> None:
    hidden = 2
    evidence.masks[hidden][:] = False
    slopes = np.zeros((2, 1, HEIGHT, WIDTH, 3))
    rows, columns = np.nonzero(binary_erosion(evidence.masks[0], iterations=2))
    patch = np.zeros((HEIGHT, WIDTH), bool)
    patch[rows[0] : rows[0] + 3, columns[0] : columns[0] + 3] = True
    slopes[:, :, patch] = 1.0
    (found,) = together.reflections(evidence, [(hidden, "diffuse")], slopes)
    assert (found & ~patch).sum() == 0 and found.sum() >= 0.8 * patch.sum()
    residuals = evidence.residuals(1, 256 * int(found.sum()), [found])
    noise = np.abs(residuals[0] - residuals[1]).mean(axis=-1)
    assert noise[found].mean() < 0.3 * noise[evidence.masks[0] & ~found].mean()


def test_what_noise_made_the_least_takes_no_step_back() -> None:
    rng = np.random.default_rng(6)
    found = [(float(error), 4e-4) for error in rng.normal(1e-4, 4e-4, 60)]
    least = min(found)
    assert least[0] < -4e-4 and not any(worse(one, least) for one in found)
    assert worse((5e-3, 4e-4), least)
    assert worse((2.1e-2, 1e-4), (1e-2, 1e-4)) and not worse((1.9e-2, 1e-4), (1e-2, 1e-4))


def test_every_window_has_all_its_pixels(evidence: Evidence) -> None:
    """Blender rounds the sides of a window down, and its floats are short."""
    for axis, size in enumerate((HEIGHT, WIDTH)):
        for first in range(size):
            mask = np.zeros((HEIGHT, WIDTH), bool)
            mask[(slice(None),) * axis + (slice(first, first + 1 + first % 5),)] = True
            assert evidence.room.pixels(mask, 1, 0).shape == (mask.sum(), 3)
