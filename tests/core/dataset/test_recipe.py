"""Recipes: what is said is kept, and what is wrong is named."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.core.brdf.files import write_npz
from pipeline.core.brdf.parametric import Ward
from pipeline.core.dataset.recipe import Recipe, template
from pipeline.core.errors import LightsphereError


def test_the_template_is_the_default_recipe_and_explains_every_value() -> None:
    text = template()
    assert Recipe.of(tomllib.loads(text)) == Recipe()
    values = [line for line in text.splitlines() if " = " in line and not line.startswith("#")]
    sections = [f for f in dataclasses.fields(Recipe) if "limits" not in f.metadata]
    assert len(values) == sum(len(dataclasses.fields(getattr(Recipe(), s.name))) for s in sections) + 5
    assert text.count("\n# ") >= len(values)


def test_a_recipe_comes_back_from_its_own_values() -> None:
    made = Recipe.of({"seed": 7, "lights": {"count": [9, 12], "layout": "near"}, "sensor": {"bits": 8}})
    assert Recipe.of(json.loads(json.dumps(made.as_json()))) == made
    assert made.lights.count == (9, 12) and made.sensor.bits == 8


def test_one_number_is_a_range_without_width_and_one_word_a_list_of_one() -> None:
    made = Recipe.of({"material": {"roughness": 0.3}, "shape": {"source": "blob"}})
    assert made.material.roughness == (0.3, 0.3)
    assert made.shape.source == ("blob",)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"colour": 1}, "colour is unknown; choose among name"),
        ({"lights": {"number": 3}}, "lights.number is unknown; choose among layout"),
        ({"lights": 3}, r"lights is no table; write \[lights\]"),
        ({"count": 0}, "count is 0; it must be from 1 to"),
        ({"count": 2.5}, "count is 2.5; give a value such as 100"),
        ({"count": True}, "count is True; give a value such as 100"),
        ({"material": {"roughness": [0.5, 0.2]}}, r"material.roughness is \[0.5, 0.2\]; give a number, or two"),
        ({"material": {"roughness": [0.5, 1.2]}}, "material.roughness is 1.2; it must be from 0 to 1"),
        ({"material": {"roughness": "dull"}}, "material.roughness is 'dull'; give a number"),
        ({"shape": {"source": [3]}}, r"shape.source is \[3\]; give a word or a list of words"),
        ({"shape": {"source": []}}, "shape.source is empty"),
        (
            {"material": {"source": ["principled", "own"]}, "shape": {"source": ["gourd", "vase"]}},
            "a vase may be drawn",
        ),
        ({"lights": {"layout": "ring"}}, "lights.layout is 'ring'; choose one of distant, near"),
        ({"lights": {"layout": "double-sphere", "count": 6}}, "two spheres need 8 lights"),
        ({"lights": {"layout": "double-sphere", "distance": 2.0}}, "lights.distance needs two numbers"),
        ({"output": {"formats": ["exr"]}}, "output.formats has 'exr'; choose among capture"),
        (
            {"output": {"formats": ["diligent"]}, "lights": {"layout": "near"}},
            "'diligent', a layout for distant lights",
        ),
        ({"output": {"formats": ["near"]}}, "'near', a layout for near lights"),
        ({"output": {"formats": ["webdataset"]}}, "'webdataset', which packs captures"),
        ({"output": {"train": 0.8, "validation": 0.3}}, "more than 1 together"),
        ({"sensor": {"read_noise": 3}}, "sensor.read_noise is in electrons"),
    ],
)
def test_what_is_wrong_is_named(values: dict[str, Any], words: str) -> None:
    with pytest.raises(LightsphereError, match=words):
        Recipe.of(values)


@pytest.mark.parametrize("text", ["count = ", "a" * 1_000_001, "x = " + "[" * 5000 + "]" * 5000, "\x00"])
def test_a_file_that_is_no_recipe_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(LightsphereError, match=r"recipe.toml"):
        Recipe.read(path)


def test_folders_and_patterns_become_sorted_files(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    for name in ("b.ply", "a.obj", "notes.txt"):
        (tmp_path / "meshes" / name).touch()
    write_npz(tmp_path / "brushed.npz", Ward(np.full(3, 0.1), np.full(3, 0.2), 0.1, 0.2))
    (tmp_path / "recipe.toml").write_text(
        'shape.source = ["blob", "meshes", "meshes/*.ply"]\nmaterial.source = "brushed.npz"\n'
    )
    found = Recipe.read(tmp_path / "recipe.toml")
    names = ["blob", *(str(tmp_path / "meshes" / name) for name in ("a.obj", "b.ply", "b.ply"))]
    assert list(found.shape.source) == names
    assert found.material.source == (str(tmp_path / "brushed.npz"),)


@pytest.mark.parametrize("source", ["none.ply", "meshes/*.ply", "empty"])
def test_a_source_without_files_is_refused(tmp_path: Path, source: str) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "recipe.toml").write_text(f'shape.source = "{source}"\n')
    with pytest.raises(LightsphereError, match="correct"):
        Recipe.read(tmp_path / "recipe.toml")


def test_the_identity_knows_files_by_their_content_not_their_place(tmp_path: Path) -> None:
    for folder, content in (("one", b"x"), ("two", b"x"), ("three", b"y")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mesh.ply").write_bytes(content)
        (tmp_path / folder / "recipe.toml").write_text('shape.source = "mesh.ply"\n')
    one, two, three = (Recipe.read(tmp_path / name / "recipe.toml").identity() for name in ("one", "two", "three"))
    assert one == two
    assert one != three
