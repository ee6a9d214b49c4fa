"""Estimates from noisy renders: planted factors come back without the bias of least squares."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.camera import Camera
from pipeline.core.errors import LightsphereError
from pipeline.core.inverse import LEAST, MOST, Model, grey, known_reflectances, moved, uncertainty
from pipeline.core.inverse.brushing import brushing
from pipeline.core.inverse.estimate import agreed, better, combined, newton, structured, unexplained
from pipeline.core.inverse.lamps import powers
from pipeline.core.inverse.photograph import averaged, inner, prepared, weights
from pipeline.core.inverse.radiosity import corrections
from pipeline.core.inverse.texture import light_on, reflectance_map, seen_reflectance, sharpened

PIXELS = 40_000
NOISE = 0.5


@pytest.fixture(scope="module")
def bases() -> tuple[np.ndarray, np.ndarray]:
    """True basis pictures (2, P, 3), and two noisy renders of each (2, 2, P, 3)."""
    rng = np.random.default_rng(0)
    true = rng.uniform(0.2, 1.0, (2, PIXELS, 3))
    return true, true + rng.normal(0, NOISE, (2, 2, PIXELS, 3))


def test_two_seeds_give_planted_factors_where_least_squares_are_biased(bases: tuple[np.ndarray, np.ndarray]) -> None:
    true, noisy = bases
    factors = np.array([[0.6, 0.3, 0.1], [0.2, 0.0, 0.5]])
    photograph = np.einsum("npc,nc->pc", true, factors)
    weight = np.ones((PIXELS, 3))
    fit = combined(noisy, photograph, weight)
    assert fit.factors == pytest.approx(factors, abs=0.03)
    plain = [np.linalg.lstsq(noisy[0, :, :, c].T, photograph[:, c], rcond=None)[0] for c in range(3)]
    assert np.abs(np.transpose(plain) - factors).max() > 0.1
    assert (fit.factors >= 0).all()


def test_what_is_shown_beside_the_bases_is_taken_off_each_seed_without_bias(
    bases: tuple[np.ndarray, np.ndarray],
) -> None:
    true, noisy = bases
    photograph = 0.4 * (true[0] - true[1]) + true[1]
    basis, beside = noisy[:, 0] - noisy[:, 1], noisy[:, 1]  # a difference to it: one noise is in both
    fit = combined(basis[:, None], photograph - beside, np.ones((PIXELS, 3)))
    assert fit.factors[0] == pytest.approx(0.4, abs=0.03)
    plain = (basis[0] * (photograph - beside[0])).sum(axis=0) / (basis[0] ** 2).sum(axis=0)
    assert np.abs(plain - 0.4).min() > 0.03


def test_render_noise_is_no_error_and_a_wrong_model_is(bases: tuple[np.ndarray, np.ndarray]) -> None:
    true, noisy = bases
    weight = np.ones((PIXELS, 3))
    right, spread = unexplained(true[0] - noisy[:, 0], weight)
    assert abs(right) < 4 * spread
    wrong, spread = unexplained(1.3 * true[0] - noisy[:, 0], weight)
    assert wrong > 4 * spread
    assert wrong == pytest.approx(np.mean((0.3 * true[0]) ** 2), rel=0.1)
    photograph = 0.5 * true[0] + 0.4 * true[1]
    simple, rich = combined(noisy[:, :1], photograph, weight), combined(noisy, photograph, weight)
    assert better(simple, rich, 1e-4)
    needless = combined(noisy, 0.5 * true[0], weight)
    assert not better(combined(noisy[:, :1], 0.5 * true[0], weight), needless, 1e-4)


@pytest.mark.parametrize("scatter", ["Gaussian", "fireflies"])
def test_how_far_noise_moves_an_error_is_told_by_one_pair_of_renders(scatter: str) -> None:
    rng = np.random.default_rng(7)
    spread = 0.2 * (1.5 + np.sin(np.arange(400) / 40))[:, None]  # alike in neighbours
    missing = 0.1 * np.cos(np.arange(400) / 60)[:, None]
    size = (600, 2, 400, 1)
    noise = rng.normal(size=size) if scatter == "Gaussian" else rng.gamma(0.2, 1.0, size) - 0.2
    noise *= spread / noise.std()
    found = np.array([unexplained(missing - np.repeat(one, 3, axis=2), np.ones((400, 3))) for one in noise])
    told, true = np.sqrt((found[:, 1] ** 2).mean()), found[:, 0].std()
    assert told == pytest.approx(true, rel=0.15), scatter
    squared = ((noise[:, 0] - noise[:, 1]) ** 2 / 2) ** 2  # what each pixel alone would say
    assert np.sqrt(squared.sum(axis=(1, 2)).mean()) / 400 > 1.3 * true


def test_what_neighbours_share_is_an_error_and_noise_of_the_photograph_is_none() -> None:
    rng = np.random.default_rng(8)
    mask = np.zeros((60, 80), bool)
    mask[5:55, 3:70] = True
    photograph = rng.normal(0, 0.5, (60, 80, 3))
    renders = rng.normal(0, 0.5, (2, 60, 80, 3))
    assert structured(photograph + renders, mask) == pytest.approx(0, abs=0.01)
    assert unexplained((photograph + renders)[:, mask], np.ones((mask.sum(), 3)))[0] == pytest.approx(0.25, rel=0.1)
    pattern = 0.4 * np.kron(rng.choice([-1.0, 1.0], (15, 20, 1)), np.ones((4, 4, 1)))
    found = structured(photograph + renders + pattern, mask)
    assert found == pytest.approx(0.16 * 3 / 4, rel=0.2)  # of four neighbours three are of the same patch
    alone = np.zeros((60, 80), bool)
    alone[::2, ::2] = True
    assert structured(renders + pattern, alone) == pytest.approx(0.16, rel=0.15)


def test_a_step_reaches_a_linear_optimum_and_leaves_what_nothing_shows() -> None:
    rng = np.random.default_rng(1)
    true = rng.normal(size=(3, 5000))
    true[2] = 0
    noisy = true + rng.normal(0, 0.3, (2, 3, 5000))
    noisy[:, 2] = 0
    planted = np.array([0.4, -0.2, 0.0])
    residuals = planted @ true + rng.normal(0, 0.2, (2, 5000))
    step, deviation = newton(noisy, residuals, np.ones(5000), damping=1e-4)
    assert step == pytest.approx(planted, abs=5 * deviation.max())
    assert 0 < deviation[0] < 0.02
    assert step[2] == 0


def test_what_is_held_at_its_bound_leaves_the_rest_to_the_others() -> None:
    rng = np.random.default_rng(4)
    first = rng.normal(size=400)
    slopes = np.stack([first, first + 0.3 * rng.normal(size=400), rng.normal(size=400)])  # two that look alike
    residuals = np.array([-0.5, 0.4, 0.1]) @ slopes
    ends = np.array([-0.2, -2.0, -2.0]), np.full(3, 2.0)
    arguments = np.stack([slopes] * 2), np.stack([residuals] * 2), np.ones(400), 0.0
    step, _ = newton(*arguments, bounds=ends)
    others = np.linalg.lstsq(slopes[1:].T, residuals + 0.2 * first, rcond=None)[0]
    assert step == pytest.approx([-0.2, *others], rel=1e-6)
    clipped = np.clip(newton(*arguments)[0], *ends)
    assert np.square(residuals - step @ slopes).sum() < 0.2 * np.square(residuals - clipped @ slopes).sum()


def test_pictures_are_averaged_exactly() -> None:
    values = np.random.default_rng(2).uniform(size=(7, 5))
    assert averaged(values, 7, 0) == pytest.approx(values)
    for count in (2, 3, 5):
        assert averaged(values, count, 0).mean(axis=0) == pytest.approx(values.mean(axis=0))
    assert averaged(np.array([1.0, 3.0, 5.0]), 2, 0) == pytest.approx([(1 + 1.5) / 1.5, (1.5 + 5) / 1.5])


def test_what_a_photograph_cannot_be_trusted_with_is_left_out() -> None:
    pixels = np.full((12, 16, 3), 0.5, np.float32)
    pixels[0, 0], pixels[5, 5, 1], pixels[7, 7] = 1.0, np.nan, -0.1
    found = prepared(pixels, 8, "linear", (32, 24), 160)
    assert found.pixels.shape == (12, 16, 3)
    assert np.isfinite(found.pixels).all()
    assert [tuple(place) for place in np.argwhere(~found.trusted)] == [(0, 0), (5, 5), (7, 7)]
    assert prepared(pixels, 32, "auto", (32, 24), 160).trusted[0, 0]
    assert prepared(pixels, 8, "srgb", (32, 24), 8).pixels[1, 1] == pytest.approx(0.2140, abs=1e-4)
    for wrong, words in ((pixels[:, :12], "aspect"), (0 * pixels, "black"), (pixels * np.nan, "broken")):
        with pytest.raises(LightsphereError, match=words):
            prepared(wrong, 32, "linear", (32, 24), 160)


def test_weights_make_errors_relative_and_edges_are_left_out() -> None:
    picture = np.ones((9, 18, 3))
    picture[:, 9:] = 10
    index = np.repeat([[0] * 9 + [1] * 9], 9, axis=0)
    weight = weights(picture)
    assert weight[4, 2, 0] / weight[4, 15, 0] == pytest.approx(((10 + 5.5 / 3) / (1 + 5.5 / 3)) ** 2)
    kept = inner(index)
    assert not kept[:, 8:10].any()
    assert kept[:, :8].all() and kept[:, 10:].all()


def test_parameters_stay_within_what_they_can_be() -> None:
    assert moved(grey(), "diffuse", 5.0).diffuse.max() == MOST
    assert moved(grey(), "diffuse", -20.0).diffuse.min() == LEAST
    brushed = Model("anisotropic", np.zeros(3), np.full(3, 0.5), 0.1, 2.0, 170.0)
    assert moved(brushed, "angle", 20.0).angle == pytest.approx(10)
    across = moved(brushed, "ratio", np.log(0.25))
    assert (across.ratio, across.angle) == (pytest.approx(2), pytest.approx(80))
    along, wide = brushed.alphas
    assert wide / along == pytest.approx(2) and along * wide == pytest.approx(0.01)


def test_a_texture_comes_back_without_the_shadow_on_it() -> None:
    v, u = np.meshgrid(np.linspace(0.98, 0.02, 40), np.linspace(0.02, 0.98, 40), indexing="ij")
    pattern = np.stack([0.2 + 0.5 * (u > 0.5), 0.3 + 0 * u, 0.6 - 0.4 * v], axis=-1)
    shadow = np.where(v < 0.4, 0.3, 1.0)[..., None] * np.ones(3)
    seen = np.ones((40, 40), bool)
    light = light_on(shadow, seen)[seen]
    values, _ = seen_reflectance((pattern * shadow)[seen], light, 0 * light, light, seen[seen])
    texture = reflectance_map(values, np.stack([u, v], axis=-1)[seen])
    side = len(texture)
    centres = (np.arange(side) + 0.5) / side
    wanted = 0.2 + 0.5 * (centres > 0.5)
    clear = np.abs(centres - 0.5) > 0.04
    assert texture[side // 8, clear, 0] == pytest.approx(wanted[clear], abs=0.01)
    dark = texture[-side // 4, clear, 0]  # in the shadow
    assert dark == pytest.approx(wanted[clear], rel=0.05)
    assert texture[side // 10, 3, 2] < texture[-side // 10, 3, 2]  # rows top-down


def test_powers_of_lamps_come_back_beside_unknown_reflectances() -> None:
    rng = np.random.default_rng(8)
    group = np.repeat([0, 1, 2], 200)
    pictures = rng.uniform(0.1, 1.0, (3, 600, 3)) * rng.uniform(0.3, 3.0, (3, 1, 1))
    rho = rng.uniform(0.2, 1.8, (3, 3))
    planted = np.array([1.0, 5.0, 0.0])
    photograph = np.tensordot(planted, pictures, 1) * rho[group]
    weight = 1 / photograph**2
    held = powers(pictures, photograph, weight, group, {}, {0: 1.0})
    assert held == pytest.approx(planted, abs=1e-3)
    scaled = powers(pictures, photograph, weight, group, {1: 0.5 * rho[1]}, {})  # half as bright: lamps are twice as
    assert scaled == pytest.approx(2 * planted, abs=2e-3)
    swapped = powers(pictures[[1, 0, 2]], photograph, weight, group, {}, {0: 1.0})
    assert swapped[1] == pytest.approx(1 / 5, abs=1e-3)


def test_known_reflectances_are_read_or_refused() -> None:
    known = known_reflectances("Floor=.2,.3,.4; My wall = 0.5, 0.5, 0.5;")
    assert known["My wall"].tolist() == [0.5, 0.5, 0.5]
    for wrong in ("Floor", "Floor=.2,.3", "=.2,.3,.4", "Floor=.2,.3,1.4", "Floor=a,b,c"):
        with pytest.raises(LightsphereError, match="GROUP=R,G,B"):
            known_reflectances(wrong)
    assert known_reflectances("") == {}


def test_a_texture_is_sharpened_until_it_renders_what_was_seen() -> None:
    def filtered(values: np.ndarray) -> np.ndarray:
        return (np.roll(values, 1, 0) + 2 * values + np.roll(values, -1, 0)) / 4

    true = np.repeat(np.where(np.arange(64) // 8 % 2 == 0, 0.2, 0.6)[:, None], 3, axis=1)
    wanted = filtered(true)
    values = wanted
    for _ in range(3):
        values = sharpened(values, wanted, filtered(values))
    assert np.abs(filtered(values) - wanted).max() < 0.3 * np.abs(filtered(wanted) - wanted).max()
    assert np.abs(values - true).max() < 0.6 * np.abs(wanted - true).max()
    assert sharpened(wanted, wanted, wanted) == pytest.approx(wanted)


def test_what_else_a_pixel_at_an_edge_shows_is_taken_off() -> None:
    light, beside, true = np.full((3, 3), 2.0), np.full((3, 3), 0.7), np.array([[0.2, 0.5, 0.8]])
    cover = np.array([[1.0], [0.7], [0.3]])
    dark = (1 - cover) * beside
    values, tells = seen_reflectance(dark + cover * light * true, light, dark, cover * light, cover[:, 0] == 1)
    assert values == pytest.approx(np.repeat(true, 3, axis=0))
    assert tells.tolist() == [True, True, False]
    blind, _ = seen_reflectance(dark + cover * light * true, light, 0 * dark, light, cover[:, 0] > 0)
    assert blind[1] != pytest.approx(true[0], rel=0.05)


def test_a_step_from_the_derivatives_own_pictures_is_not_biased() -> None:
    rng = np.random.default_rng(12)
    true = rng.normal(1, 0.3, (2, 40_000))
    planted = np.array([0.2, -0.1])
    noisy = true + rng.normal(0, 0.6, (2, *true.shape))  # two seeds
    at = np.array([0.5, 0.4])
    photograph = (at + planted) @ true
    residuals = photograph - np.einsum("u,sun->sn", at, noisy)
    step, _ = newton(noisy, residuals, np.ones(40_000), damping=1e-6, same_seeds=True)
    assert step == pytest.approx(planted, abs=0.02)
    biased, _ = newton(noisy, residuals, np.ones(40_000), damping=1e-6)
    assert np.abs(biased - planted).max() > 0.1


def test_what_two_seeds_do_not_agree_on_has_no_part_in_a_fit(bases: tuple[np.ndarray, np.ndarray]) -> None:
    true, noisy = bases
    rng = np.random.default_rng(3)
    fireflies = np.zeros((2, 1, PIXELS, 3))
    for seed in fireflies:
        seed[0, rng.choice(PIXELS, 20)] = rng.uniform(1e3, 1e4, (20, 3))
    weight = np.ones((PIXELS, 3))
    fit = combined(np.concatenate([noisy[:, :1], fireflies], axis=1), 0.5 * true[0], weight)
    assert (fit.factors[1] == 0).all()
    assert fit.factors[0] == pytest.approx([0.5] * 3, abs=0.02)
    assert abs(fit.error) < 4 * fit.noise < 0.01
    # a faint picture that is spread wide, and a bright one of few pixels, are no noise
    faint = 0.07 * true[1] + rng.normal(0, 0.3, (2, *true[1].shape))
    spot = np.zeros((2, PIXELS))
    spot[:, :5] = rng.uniform(5, 10, (2, 5))
    assert agreed(*np.stack([faint[..., 0], spot], axis=1), weight[:, 0]).all()
    assert not agreed(*rng.normal(0, 1, (2, 2, PIXELS)), weight[:, 0]).any()


def test_a_faint_reflectance_makes_a_surface_no_less_certain() -> None:
    deviation = {"diffuse": [2.0, 2.0, 2.0], "specular": [0.01, 0.02, 0.01]}
    found = {"rho_d": [1e-3, 1e-3, 1e-3], "rho_s": [0.9, 0.9, 0.9], "deviation": deviation}
    assert uncertainty(found) == pytest.approx(2.0 * 1e-3 / (0.05 * 0.9))
    assert uncertainty(found | {"rho_d": [0.3, 0.3, 0.3]}) == pytest.approx(2.0)
    assert uncertainty({"rho_d": [0.5, 0.1, 0.2], "deviation": {"diffuse": [0.01, 0.03, 0.02]}}) == pytest.approx(0.03)
    assert uncertainty({"level": "texture", "deviation": {}}) == 0


def test_reflectances_follow_from_radiosity_at_once_where_ratios_are_far_off() -> None:
    rng = np.random.default_rng(4)
    exchanged = rng.uniform(0, 1, (5, 5))
    exchanged *= 0.9 / exchanged.sum(axis=1, keepdims=True)
    lamp = rng.uniform(0, 1, 5)
    begun, true = np.full(5, 0.5), rng.uniform(0.2, 0.98, 5)

    def radiances(rho: np.ndarray) -> np.ndarray:
        return np.linalg.solve(np.eye(5) - rho[:, None] * exchanged, rho * lamp)

    shown = radiances(begun)
    glow = np.linalg.inv(np.eye(5) - begun[:, None] * exchanged) * shown / shown[:, None]
    ratios = radiances(true) / shown
    found = begun[:, None] * corrections(np.repeat(glow[..., None], 3, axis=2), np.repeat(ratios[:, None], 3, axis=1))
    assert found == pytest.approx(np.repeat(true[:, None], 3, axis=1), rel=1e-9)
    assert np.abs(begun * ratios / true - 1).max() > 0.3


def test_what_noise_makes_of_gains_gives_reflectances_that_can_be() -> None:
    gains = np.array([[0.9, 0.5], [-0.1, 0.6]])  # less than their own glow, light taken away, more than all light
    factors = corrections(np.repeat(gains[..., None], 3, axis=2), np.array([[3.0] * 3, [0.5] * 3]))
    assert ((factors > 0.1) & (factors <= 6)).all()
    gains[:, 1] = 0.0  # a glow that does not show
    assert corrections(np.repeat(gains[..., None], 3, axis=2), np.array([[3.0] * 3, [0.5] * 3])).min() > 0.1


def streaks(angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Camera]:
    """A tilted plate, brushed at an angle from its U [degrees], that shows small bright things smeared across it."""
    matrix = np.eye(4)
    matrix[:3, 3] = 0.1, -0.2, 3.0
    camera = Camera("pinhole", matrix, (64, 48), (90.0, 90.0), (32.0, 24.0))
    origins, directions = camera.rays()
    normal = np.array([0.3, -0.5, 1.0]) / np.linalg.norm([0.3, -0.5, 1.0])
    depth = -(origins @ normal) / (directions @ normal)
    places = origins + depth[..., None] * directions
    u = np.cross([0.2, 1.0, 0.0], normal)
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    uv = 0.3 * np.stack([places @ u, places @ v], axis=-1) + 0.5
    turned = np.radians(angle)
    wide = np.cos(turned) * v - np.sin(turned) * u
    rng = np.random.default_rng(3)
    centres = rng.uniform((0, 0), (48, 64), (60, 2)).astype(int)
    picture = np.full((48, 64), 0.05)
    rows, columns = np.mgrid[:48, :64] + 0.5
    for row, column in centres:
        place, towards = places[row, column], directions[row, column]
        smear = wide * (towards @ normal) - normal * (towards @ wide)
        ends = camera.project(np.stack([place, place + 1e-3 * smear]))[0]
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        off = np.stack([columns - ends[0, 0], rows - ends[0, 1]], axis=-1)
        far = off @ along
        aside = off @ np.array([-along[1], along[0]])
        picture += np.exp(-((far / 10) ** 2) - (aside / 1.5) ** 2)
    mask = np.ones((48, 64), bool)
    return np.repeat(picture[..., None], 3, axis=2), mask, places, uv, camera


@pytest.mark.parametrize("angle", [0.0, 25.0, 80.0, 140.0])
def test_the_brushing_is_told_by_what_reflections_are_smeared_along(angle: float) -> None:
    photograph, mask, places, uv, camera = streaks(angle)
    found = brushing(photograph, mask, places, uv, camera)
    assert found is not None and abs((found - angle + 90) % 180 - 90) <= 5
    turned = brushing(photograph, mask, places, uv[..., ::-1] * np.array([1.0, -1.0]), camera)  # U by 90 degrees
    assert turned is not None and abs((turned - found) % 180 - 90) <= 5


def test_nothing_is_told_of_a_curved_surface_and_of_few_pixels() -> None:
    photograph, mask, places, uv, camera = streaks(25.0)
    bent = places + 0.5 * (places[..., :1] - places[..., :1].mean()) ** 2
    assert brushing(photograph, mask, bent, uv, camera) is None
    few = np.zeros_like(mask)
    few[:5, :5] = True
    assert brushing(photograph, few, places, uv, camera) is None
