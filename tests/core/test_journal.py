"""The list of finished files, whatever happened to the process that wrote it."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.core.errors import LightsphereError
from pipeline.core.journal import Journal

SUM = "0123456789abcdef" * 4


def test_finished_files_are_read_back(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal")
    assert journal.read() == {}
    journal.add("a.exr", SUM)
    journal.add("b  c.exr", SUM[::-1])
    assert Journal(tmp_path / "journal").read() == {"a.exr": SUM, "b  c.exr": SUM[::-1]}
    journal.remove()
    assert journal.read() == {}


@pytest.mark.parametrize("kept", [1, 40, 64, 65, 66, 70, 71])
def test_line_cut_by_a_kill_counts_as_not_done(tmp_path: Path, kept: int) -> None:
    journal = Journal(tmp_path / "journal")
    journal.add("a.exr", SUM)
    journal.add("b.exr", SUM)
    whole = journal.path.read_bytes()
    journal.path.write_bytes(whole[: len(whole) // 2 + kept])
    assert journal.read() == {"a.exr": SUM}
    journal.add("c.exr", SUM)
    journal.add("d.exr", SUM)
    assert journal.read()["d.exr"] == SUM
    assert "b.exr" not in journal.read()


def test_closed_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(LightsphereError, match="nowhere"):
        Journal(tmp_path / "nowhere" / "journal").add("a.exr", SUM)
