"""The command line as a contract: what scripts outside the project rely on."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer.main

from pipeline import cli
from pipeline.commands.stage import Figures, JsonLines, as_json
from pipeline.core.progress import Progress

ROOT = Path(__file__).parents[1]
COMMANDS = list(typer.main.get_command(cli.app).commands)


def lightsphere(*words: str) -> subprocess.CompletedProcess[str]:
    """Run the command as a script would."""
    return subprocess.run([sys.executable, "-m", "pipeline", *words], cwd=ROOT, capture_output=True, text=True)


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return the one line on stderr of a command that must end with status 2."""
    assert cli.main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1 and err.startswith("lightsphere: ")
    return err


def test_no_words_show_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 0
    assert "capture" in capsys.readouterr().out


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([command, "--help"]) == 0
    assert f"lightsphere {command}" in capsys.readouterr().out


def test_the_stages_are_there() -> None:
    assert {"scenes", "capture", "shape", "material", "demo"} <= set(COMMANDS)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["polish"], "polish"),
        (["scenes", "--colour"], "--colour"),
        (["capture"], "argument"),
        (["shape", "nowhere", "-o", "out", "--no-such"], "--no-such"),
    ],
)
def test_a_wrong_word_is_told_on_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, *words)
    assert said in line and "--help" in line


def test_a_folder_that_is_no_capture_is_told_on_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, "shape", str(tmp_path), "-o", str(tmp_path / "shape"))
    assert str(tmp_path) in line and "lightsphere capture" in line


def test_an_unknown_scene_is_told_on_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "teacup" in refused(capsys, "capture", "teacup", "-o", str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_program_sees_the_status_and_no_traceback(tmp_path: Path) -> None:
    run = lightsphere("shape", str(tmp_path), "-o", str(tmp_path / "shape"))
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1 and "Traceback" not in run.stderr


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("start", ["", "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"])
def test_an_interrupt_ends_with_130(start: str) -> None:
    code = (
        f"{start}import sys, time; from pipeline import cli\n"
        "@cli.app.command('wait')\n"
        "def wait() -> None:\n"
        "    print('ready', flush=True); time.sleep(30)\n"
        "sys.exit(cli.main(['wait']))"
    )
    process = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None and process.stdout.readline() == b"ready\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert err.count(b"\n") == 1 and b"interrupted" in err


def test_figures_are_written_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with Figures("shape", tmp_path / "figures.json") as figures:
        figures.values["depth_median_pct"] = 0.5
        figures.summary = "all well"
    written = json.loads((tmp_path / "figures.json").read_text())
    assert written["depth_median_pct"] == 0.5
    assert written["seconds"] >= 0
    assert os.name == "nt" or written["peak_memory_mb"] > 1
    assert capsys.readouterr().out.startswith("shape: all well (")


def test_a_failed_run_writes_no_figures(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), Figures("shape", tmp_path / "figures.json"):
        raise ZeroDivisionError
    assert not (tmp_path / "figures.json").exists()


def test_progress_lines_keep_first_and_last_step_and_are_few(capsys: pytest.CaptureFixture[str]) -> None:
    report = JsonLines()
    for stage in ("render", "solve"):
        for done in range(1, 1001):
            report(Progress(stage, done, 1000, "pictures"))
    steps = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert steps[0] == {"stage": "render", "done": 1, "total": 1000, "unit": "pictures"}
    assert [s["stage"] for s in steps if s["done"] == 1000] == ["render", "solve"]
    assert [s["stage"] for s in steps if s["done"] == 1] == ["render", "solve"]
    assert len(steps) < 200


def test_the_versions_agree() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))["version"]
    assert project == manifest


def test_figures_that_are_no_numbers_become_null() -> None:
    written = as_json({"a": float("nan"), "b": [1.5, {"c": float("inf")}], "d": "nan"})
    assert json.loads(written) == {"a": None, "b": [1.5, {"c": None}], "d": "nan"}
