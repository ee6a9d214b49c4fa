"""The folder: a sample is there when its list is, and every change of a file is found."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from pipeline.core.dataset import folder as dataset
from pipeline.core.dataset import shards
from pipeline.core.dataset.draw import draw, sample_name
from pipeline.core.dataset.recipe import SPLITS, Recipe
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish

COUNT = 5
RECIPE = Recipe.of({"count": COUNT, "output": {"formats": ["capture", "webdataset"], "shard": 2}})
SAMPLES = [draw(RECIPE, index) for index in range(COUNT)]


def commit(folder: Path, index: int, content: str = "picture") -> None:
    made = folder / f".{index}{dataset.PART}"
    place = made / "capture" / sample_name(index)
    place.mkdir(parents=True)
    (place / "light.exr").write_text(f"{content} {index}")
    (place / "capture.json").write_text("{}")
    dataset.commit(made, folder, index)


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A whole dataset of files that are no pictures."""
    dataset.begin(tmp_path, RECIPE, {"blender": "5.2"})
    for index in range(COUNT):
        commit(tmp_path, index)
    dataset.remove_partial(tmp_path)
    dataset.write_manifest(tmp_path, SAMPLES, {})
    dataset.list_shared(tmp_path, [tmp_path / dataset.MANIFEST])
    return tmp_path


def test_a_whole_dataset_has_no_faults(made: Path) -> None:
    assert finish(dataset.verify(made)) == []
    assert finish(dataset.to_make(made, range(COUNT))) == []
    assert dataset.recipe_of(made) == RECIPE
    rows = [json.loads(line) for line in (made / dataset.MANIFEST).read_text().splitlines()]
    assert [row["index"] for row in rows] == list(range(COUNT))
    assert {row["split"] for row in rows} <= set(SPLITS)
    assert not list(made.glob(f".*{dataset.PART}"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("capture/00000002/light.exr", "capture/00000002/light.exr is"),
        ("finished/00000002.sha256", "finished/00000002.sha256 is"),
        ("samples.jsonl", "samples.jsonl is"),
    ],
)
@pytest.mark.parametrize("harm", ["cut", "flipped", "removed"])
def test_every_harm_is_found(made: Path, name: str, words: str, harm: str) -> None:
    path = made / name
    data = path.read_bytes()
    if harm == "cut":
        path.write_bytes(data[: len(data) // 2])
    elif harm == "flipped":
        path.write_bytes(data[:-2] + bytes([data[-2] ^ 1]) + data[-1:])
    else:
        path.unlink()
    assert any(words in fault for fault in finish(dataset.verify(made)))
    if name.startswith("capture/"):
        assert finish(dataset.to_make(made, range(COUNT))) == [2]


def test_a_sample_made_again_takes_the_place_of_a_damaged_one(made: Path) -> None:
    (made / "capture/00000002/light.exr").write_text("damaged")
    (made / "capture/00000002/left.exr").write_text("of another version")
    commit(made, 2)
    assert finish(dataset.verify(made)) == []
    assert sorted(path.name for path in (made / "capture/00000002").iterdir()) == ["capture.json", "light.exr"]


def test_two_processes_may_put_the_same_sample_in_place_at_once(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place, remove = made / "capture" / sample_name(2), shutil.rmtree

    def and_the_other_is_quicker(path: Path, ignore_errors: bool) -> None:
        remove(path, ignore_errors=ignore_errors)
        if path == place:
            shutil.copytree(made.with_name("equal"), place)

    shutil.copytree(place, made.with_name("equal"))
    monkeypatch.setattr(shutil, "rmtree", and_the_other_is_quicker)
    commit(made, 2)
    monkeypatch.undo()
    dataset.remove_partial(made)
    assert finish(dataset.verify(made)) == []


def test_a_list_that_leads_out_of_the_folder_is_refused(made: Path) -> None:
    outside = made.parent / "outside.txt"
    outside.write_text("secret")
    listed = dataset.finished_list(made, 1)
    listed.write_text(f"{'0' * 64}  ../outside.txt\n{'0' * 64}  {outside}\n")
    assert [fault for fault in finish(dataset.verify(made)) if "outside of the dataset" in fault]
    (made / "capture/link").symlink_to(outside)
    listed.write_text(f"{'0' * 64}  capture/link\n")
    assert dataset.damages(made, listed) == ["capture/link lies outside of the dataset"]


def test_two_runs_do_not_work_in_one_folder(tmp_path: Path) -> None:
    with (
        dataset.alone(tmp_path),
        pytest.raises(LightsphereError, match="another run is at work"),
        dataset.alone(tmp_path),
    ):
        pass
    with dataset.alone(tmp_path):
        pass
    code = f"from pipeline.core.dataset import folder; folder.alone(folder.Path({str(tmp_path)!r})).__enter__(); 1 / 0"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 1
    with dataset.alone(tmp_path):  # the other one has ended
        pass


def test_another_recipe_in_the_same_folder_is_refused(made: Path) -> None:
    dataset.begin(made, RECIPE, {"blender": "5.2"})
    with pytest.raises(LightsphereError, match=r"another seed; choose another folder"):
        dataset.begin(made, Recipe.of({**RECIPE.as_json(), "seed": 1}), {"blender": "5.2"})
    with pytest.raises(LightsphereError, match=r"another made_by"):
        dataset.begin(made, RECIPE, {"blender": "4.5"})


def test_a_file_may_be_mended_until_a_sample_is_made_of_it(tmp_path: Path) -> None:
    place, meshes = tmp_path / "made", [tmp_path / "bad.ply", tmp_path / "good.ply"]
    for mesh in meshes:
        mesh.write_text("first")
    recipe = Recipe.of({"count": 12, "shape": {"source": [str(mesh) for mesh in meshes]}})
    dataset.begin(place, recipe, {})
    for index in range(12):
        if draw(recipe, index).shape == str(meshes[1]):
            commit(place, index)
    meshes[0].write_text("mended")
    dataset.begin(place, recipe, {})
    identity = json.loads((place / dataset.RECIPE).read_text())["identity"]
    assert identity == json.loads(json.dumps(recipe.identity() | {"made_by": {}}))
    meshes[1].write_text("mended")
    with pytest.raises(LightsphereError, match="another shape"):
        dataset.begin(place, recipe, {})


def test_missing_samples_are_listed_until_they_are_there(made: Path) -> None:
    dataset.write_manifest(made, [*SAMPLES[:3], SAMPLES[4]], {3: "its mesh is broken"})
    assert json.loads((made / dataset.MISSING).read_text()) == {"00000003": "its mesh is broken"}
    assert len((made / dataset.MANIFEST).read_text().splitlines()) == COUNT - 1
    dataset.write_manifest(made, SAMPLES, {})
    assert not (made / dataset.MISSING).exists()


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"format": "other"}', '{"format": "lightsphere-dataset"}', "[" * 9999]
)
def test_a_damaged_description_is_said(tmp_path: Path, text: str) -> None:
    (tmp_path / dataset.RECIPE).write_text(text)
    with pytest.raises(LightsphereError, match=r"recipe"):
        finish(dataset.verify(tmp_path))


def test_shards_hold_every_sample_once_in_its_split_whatever_the_order(made: Path) -> None:
    packed = finish(shards.write(made, SAMPLES, RECIPE.output.shard))
    before = [path.read_bytes() for path in packed]
    names = []
    for path in packed:
        with tarfile.open(path) as tar:
            members = tar.getmembers()
            names += [member.name for member in members]
            assert len(members) <= 2 * RECIPE.output.shard
            assert all(member.mtime == member.uid == 0 for member in members)
            for member in members:
                index = int(member.name.split(".")[0])
                assert path.name.startswith(SAMPLES[index].split)
                if member.name.endswith(".light.exr"):
                    stream = tar.extractfile(member)
                    assert stream is not None and stream.read() == f"picture {index}".encode()
    assert sorted(names) == [f"{sample_name(i)}.{end}" for i in range(COUNT) for end in ("capture.json", "light.exr")]
    (made / "webdataset" / "train-000099.tar").touch()
    assert [path.read_bytes() for path in finish(shards.write(made, SAMPLES, RECIPE.output.shard))] == before
    assert not (made / "webdataset" / "train-000099.tar").exists()
