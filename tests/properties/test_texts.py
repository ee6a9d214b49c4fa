"""What people write is understood as it was meant, or refused in words."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core import light_file
from pipeline.core.dataset.recipe import Recipe
from pipeline.core.errors import LightsphereError
from pipeline.core.inverse import known_reflectances, thresholds
from pipeline.core.lights import SURFACES
from pipeline.core.photographs.response import response_of

WORDS = st.text(st.characters(codec="utf-8", exclude_characters=",#\r\n", exclude_categories=["Z", "C"]), min_size=1)
NUMBERS = st.floats(-1e6, 1e6).map(lambda value: round(value, 6))


@st.composite
def lights(draw: st.DrawFn) -> tuple[str, list[float], list[float] | None, str]:
    """A light: its picture's name, place, intensity, surface."""
    name = draw(WORDS.filter(lambda word: not is_number(word) and word not in SURFACES))
    place = draw(st.lists(NUMBERS, min_size=3, max_size=3))
    intensity = draw(st.one_of(st.none(), st.lists(st.floats(0.001, 1e4), min_size=3, max_size=3)))
    return name, place, intensity, draw(st.sampled_from(["", *SURFACES]))


def is_number(word: str) -> bool:
    with contextlib.suppress(ValueError):
        float(word)
        return True
    return False


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("texts")


@given(st.lists(lights(), min_size=1, max_size=5), st.sampled_from([" ", ",", "  "]), st.booleans())
def test_a_list_of_lights_is_read_as_it_was_written(
    folder: Path, listed: list[tuple[str, list[float], list[float] | None, str]], between: str, counted: bool
) -> None:
    lines = [str(len(listed))] * counted
    for name, place, intensity, surface in listed:
        words = [name, *map(repr, place), *map(repr, intensity or []), *([surface] if surface else [])]
        lines.append(between.join(words))
    path = folder / "lights.txt"
    path.write_text("\n".join(lines), encoding="utf-8")
    found = light_file.entries(path)
    for entry, (name, place, intensity, surface) in zip(found, listed, strict=True):
        assert entry == {"position": place, "intensity": intensity, "surface": surface, "file": name}


@given(st.text(), st.sampled_from(["lights.txt", "lights.lp", "lights.csv", "lights.json"]))
def test_any_text_is_a_list_of_lights_or_refused(folder: Path, text: str, name: str) -> None:
    path = folder / name
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with contextlib.suppress(LightsphereError):
        found = light_file.read(path, np.zeros(3))
        assert np.isfinite(found.position).all() and (found.intensity >= 0).all()


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["lights", "position", "x"]), inner),
    max_leaves=12,
)


@given(JSON)
def test_any_json_is_a_list_of_lights_or_refused(folder: Path, value: Any) -> None:
    path = folder / "any.json"
    path.write_text(json.dumps(value), encoding="utf-8")
    with contextlib.suppress(LightsphereError):
        found = light_file.read(path, np.zeros(3))
        assert np.isfinite(found.position).all()


@given(
    st.dictionaries(
        WORDS.filter(lambda word: ";" not in word), st.lists(st.floats(0.001, 0.999), min_size=3, max_size=3)
    )
)
def test_known_reflectances_are_read_as_they_were_written(wanted: dict[str, list[float]]) -> None:
    text = ";".join(f"{name}={','.join(map(repr, rho))}" for name, rho in wanted.items())
    found = known_reflectances(text)
    assert {name: rho.tolist() for name, rho in found.items()} == wanted


@given(st.text())
def test_any_text_is_a_setting_or_refused(text: str) -> None:
    for read in (known_reflectances, thresholds, lambda words: response_of(words, 8)):
        with contextlib.suppress(LightsphereError):
            read(text)  # type: ignore[operator]


@given(st.dictionaries(st.sampled_from(["count", "seed", "shape", "material", "lights", "camera", "sensor"]), JSON))
def test_any_values_are_a_recipe_or_refused(values: dict[str, Any]) -> None:
    with contextlib.suppress(LightsphereError):
        recipe = Recipe.of(values)
        assert Recipe.of(recipe.as_json()) == recipe
