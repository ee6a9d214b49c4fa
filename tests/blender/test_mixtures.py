"""Mixtures of closures through nodes and Cycles: what is rendered is what was foreseen, at every slider's default."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.blender import views
from pipeline.blender.ball import ball_camera, ball_scene, dress
from pipeline.blender.mixtures import mixture_group, mixture_material
from pipeline.blender.round_trip import round_trip
from pipeline.core.lights import Lights
from pipeline.core.material import STOPS, Mixture
from pipeline.core.material.closures import Lobe
from pipeline.core.material.surface import Surface
from pipeline.core.progress import finish
from tests import tolerances

LOBES = (
    Lobe("diffuse"),
    Lobe("ggx", 0.25),
    Lobe("beckmann", 0.5),
    Lobe("fresnel", 0.4),
    Lobe("retro", 0.5),
    Lobe("sheen", 0.4),
)


def mixture(lobes: tuple[Lobe, ...] = LOBES, bases: int = 2, seed: int = 1) -> Mixture:
    """A mixture with curves of all colours, grey for the fresnel lobe."""
    curves = np.random.default_rng(seed).uniform(0.1, 1, (bases, len(lobes), len(STOPS), 3)) / len(lobes)
    for number, lobe in enumerate(lobes):
        if lobe.kind == "fresnel":
            curves[:, number] = curves[:, number, :, :1]
    return Mixture(lobes, curves)


@dataclasses.dataclass(frozen=True)
class Base:
    """A basis of a mixture as a BRDF."""

    whole: Mixture
    number: int
    isotropic: bool = True

    def evaluate(self, wi: NDArray[Any], wo: NDArray[Any]) -> NDArray[np.float64]:
        return self.whole.evaluate(wi, wo)[:, self.number] / wi[:, 2, None]


def weights(*values: float) -> NDArray[np.float32]:
    return np.array(values, np.float32).reshape(1, 1, len(values), 1)


def shown(material: bpy.types.Material, item: bpy.types.Object, scene: bpy.types.Scene) -> NDArray[np.float32]:
    """The ball under one sun that makes a highlight."""
    dress(item, material)
    sun = Lights("distant", np.array([[0.5, -0.8, 0.33]]), np.ones((1, 3)), np.zeros(1, int))
    return finish(views.under_lights(scene, ball_camera(32), sun))[0]


def set_inputs(material: bpy.types.Material, **values: Any) -> bpy.types.Material:
    group = next(node for node in material.node_tree.nodes if node.type == "GROUP")
    for name, value in values.items():
        group.inputs[name.replace("_", " ")].default_value = value
    return material


def test_cycles_renders_every_closure_as_foreseen() -> None:
    made = mixture()
    turn = finish(round_trip(made, [Base(made, 0), Base(made, 1)]))
    assert turn.against_mixture.max() < tolerances.RENDERED
    assert turn.pictures.shape[0] == 2 and turn.pictures.max() > 0.1


@pytest.mark.parametrize("lobe", LOBES, ids=lambda lobe: lobe.kind)
def test_a_closure_five_per_cent_too_bright_does_not_pass(lobe: Lobe) -> None:
    made = mixture((lobe,), 1)
    wrong = dataclasses.replace(made, curves=1.05 * made.curves)
    turn = finish(round_trip(made, [Base(wrong, 0)]))
    assert turn.against_mixture[0] < tolerances.RENDERED
    assert turn.against_table[0] == pytest.approx(0.05 / 1.05, rel=0.05)


@pytest.mark.parametrize("aspect", [4.0, 0.25])
def test_a_brushed_lobe_is_stretched_along_the_texture(aspect: float) -> None:
    made = mixture((Lobe("ggx", 0.4, aspect),), 1)
    turned = mixture((Lobe("ggx", 0.4, 1 / aspect),), 1)
    turn = finish(round_trip(made, [Base(turned, 0, False)]))
    assert turn.against_mixture[0] < tolerances.RENDERED < 0.3 < turn.against_table[0]


@pytest.fixture
def stage() -> tuple[bpy.types.Object, bpy.types.Scene]:
    scene, item = ball_scene()
    return item, scene


def test_exchanging_two_bases_is_exchanging_their_weights(stage: Any) -> None:
    made = mixture(bases=3)
    wanted = shown(mixture_material("b", Surface(made, weights(0.1, 0.7, 0.4))), *stage)
    exchanged = set_inputs(mixture_material("a", Surface(made, weights(0.7, 0.1, 0.4))), Exchange_1_and_2=1.0)
    np.testing.assert_allclose(shown(exchanged, *stage), wanted, rtol=1e-5)
    other = set_inputs(mixture_material("c", Surface(made, weights(0.7, 0.1, 0.4))), Exchange_1_and_3=1.0)
    assert not np.allclose(shown(other, *stage), wanted, rtol=0.05)


EDITS: dict[str, tuple[dict[str, Any], Callable[[NDArray[Any]], NDArray[Any]]]] = {
    "specular": ({"Specular_Scale": 0.5}, lambda c: c * np.where(np.arange(6) > 0, 0.5, 1.0)[:, None, None]),
    "specular of one basis": (
        {"Specular_2": 0.0},
        lambda c: c * np.where((np.arange(6) > 0) & (np.arange(2) == 1)[:, None], 0.0, 1.0)[:, :, None, None],
    ),
    "strength": ({"Strength_1": 0.25}, lambda c: c * np.array([0.25, 1.0])[:, None, None, None]),
    "tint": (
        {"Tint": (1.0, 0.5, 0.25, 1.0)},
        lambda c: np.where((np.arange(6) == 0)[:, None, None], c * [1.0, 0.5, 0.25], c),
    ),
}


@pytest.mark.parametrize("edit", EDITS)
def test_a_slider_is_the_edit_that_it_says(stage: Any, edit: str) -> None:
    values, changed = EDITS[edit]
    made = mixture()
    plain = mixture_material("plain", Surface(made, weights(0.6, 0.8)))
    wanted = mixture_material(
        "wanted", Surface(dataclasses.replace(made, curves=changed(made.curves)), weights(0.6, 0.8))
    )
    edited = set_inputs(mixture_material("edited", Surface(made, weights(0.6, 0.8))), **values)
    got, before = shown(edited, *stage), shown(plain, *stage)
    np.testing.assert_allclose(got, shown(wanted, *stage), rtol=1e-4, atol=1e-7)
    assert not np.allclose(got, before, rtol=0.02)


def test_roughness_scale_is_that_of_every_lobe(stage: Any) -> None:
    made = mixture((Lobe("diffuse"), Lobe("ggx", 0.2)), 1)
    wider = dataclasses.replace(made, lobes=(Lobe("diffuse"), Lobe("ggx", 0.3)))
    scaled = set_inputs(mixture_material("a", Surface(made, weights(1.0))), Roughness_Scale=1.5)
    np.testing.assert_allclose(
        shown(scaled, *stage), shown(mixture_material("b", Surface(wider, weights(1.0))), *stage), rtol=1e-4
    )


@pytest.mark.parametrize(("bases", "sets", "textures"), [(1, 1, 1), (2, 1, 1), (3, 1, 1), (4, 1, 1), (2, 3, 2)])
def test_weight_maps_take_as_few_textures_as_they_can(stage: Any, bases: int, sets: int, textures: int) -> None:
    """Rendered, a map that is constant on the left half and on the right one is that constant there."""
    made = mixture((Lobe("diffuse"),), bases)
    values = np.random.default_rng(2).uniform(0.2, 1, (2, bases, sets)).astype(np.float32)
    halves = np.repeat(values, [12, 4], axis=0)[None].repeat(4, axis=0)  # u from .5 to 1 is seen
    material = mixture_material("map", Surface(made, halves))
    assert sum(node.type == "TEX_IMAGE" for node in material.node_tree.nodes) == textures
    got = shown(material, *stage)
    for half, columns in ((0, slice(4, 12)), (1, slice(20, 28))):
        constant = mixture_material("constant", Surface(made, values[half][None, None]))
        wanted = shown(constant, *stage)
        np.testing.assert_allclose(got[12:20, columns], wanted[12:20, columns], rtol=2 * tolerances.TEXTURE)


def test_a_neutral_normal_map_changes_nothing_and_another_does(stage: Any) -> None:
    made = mixture(bases=1)
    neutral = np.broadcast_to(np.float32([0.5, 0.5, 1.0]), (8, 8, 3)).copy()
    tilted = np.broadcast_to(np.float32([0.6, 0.5, 0.98]), (8, 8, 3)).copy()
    plain = shown(mixture_material("plain", Surface(made, weights(1.0))), *stage)
    mapped = [shown(mixture_material("map", Surface(made, weights(1.0)), m), *stage) for m in (neutral, tilted)]
    inside = np.s_[8:24, 8:24]
    np.testing.assert_allclose(mapped[0][inside], plain[inside], rtol=tolerances.NODES, atol=1e-6)
    assert not np.allclose(mapped[1][inside], plain[inside], rtol=0.02)


def test_the_group_explains_itself(stage: Any) -> None:
    group = mixture_group("group", mixture(bases=3), False, True)
    sockets = [item for item in group.interface.items_tree if item.item_type == "SOCKET" and item.in_out == "INPUT"]
    assert all(socket.description for socket in sockets)
    assert {"Weight 1", "Weight 3", "Specular Scale", "Roughness Scale", "Exchange 2 and 3"} <= {
        s.name for s in sockets
    }
    places = [tuple(node.location) for node in group.nodes if node.type != "FRAME"]
    assert len(set(places)) == len(places)
    assert all(node.label for node in group.nodes if node.type == "FRAME")


def test_a_material_carries_its_errors() -> None:
    surface = Surface(mixture(bases=1), weights(1.0), notes={"material_rel_rms": [0.07], "lobes": ["diffuse 0"]})
    material = mixture_material("noted", surface)
    assert list(material["material_rel_rms"]) == pytest.approx([0.07]) and material["lobes"][0] == "diffuse 0"
