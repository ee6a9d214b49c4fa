"""Set-up: a missing system library is told with the package that has it."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def bootstrap() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bootstrap", ROOT / "bootstrap.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def loader_error(name: str) -> str:
    return (
        'Traceback (most recent call last):\n  File "<string>", line 1, in <module>\n'
        f"ImportError: {name}: cannot open shared object file: No such file or directory\n"
    )


def test_the_package_of_a_missing_library_is_named(bootstrap: ModuleType) -> None:
    text = bootstrap.explain_import_error(loader_error("libXrender.so.1"))
    assert "apt-get install libxrender1\n" in text
    assert "dnf install libXrender\n" in text
    assert "libgl1" not in text  # nothing that is not missing
    assert "Traceback" not in text


def test_all_missing_libraries_come_in_one_command(bootstrap: ModuleType) -> None:
    text = bootstrap.explain_import_error(loader_error("libXi.so.6"), ["libSM.so.6", "libXi.so.6"])
    assert "apt-get install libsm6 libxi6\n" in text


def test_a_library_nobody_knows_gets_a_way_to_find_it(bootstrap: ModuleType) -> None:
    text = bootstrap.explain_import_error(loader_error("libnew-thing.so.3"))
    assert "apt-file search libnew-thing.so.3" in text
    assert "apt-get install" not in text


def test_another_error_is_shown_as_it_is(bootstrap: ModuleType) -> None:
    text = bootstrap.explain_import_error("ImportError: numpy.core.multiarray failed to import")
    assert "numpy.core.multiarray failed to import" in text
    assert "apt" not in text


def test_libraries_that_are_there_are_not_reported(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bootstrap, "SYSTEM_LIBRARIES", {"libc.so.6": ("libc6", "glibc"), "libabsent.so.9": ("a", "b")})
    monkeypatch.setattr(sys, "platform", "linux")
    assert bootstrap.missing_libraries()[-1] == "libabsent.so.9"
    assert not sys.platform.startswith("linux") or bootstrap.missing_libraries() == ["libabsent.so.9"]


def test_a_changed_project_file_asks_for_set_up_again(
    bootstrap: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pyproject.toml").write_text("a")
    monkeypatch.setattr(bootstrap, "ROOT", tmp_path)
    first = bootstrap.fingerprint()
    assert bootstrap.fingerprint() == first
    (tmp_path / "pyproject.toml").write_text("b")
    assert bootstrap.fingerprint() != first


def test_without_words_it_explains_itself() -> None:
    run = subprocess.run([sys.executable, str(ROOT / "bootstrap.py")], capture_output=True, text=True, check=True)
    assert "bootstrap.py demo -o demo_out" in run.stdout and "bootstrap.py test" in run.stdout
