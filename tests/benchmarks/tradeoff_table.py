"""Accuracy against time of every stage on built-in scenes: docs/tradeoff.md and docs/tradeoff.png.

    python tests/benchmarks/tradeoff_table.py --cache FOLDER [--write]

Captures and shapes are kept in the cache; the trials run anew. With --write the table and the plot in docs/ are
replaced by what was measured.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from datetime import date
from pathlib import Path

from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline import cli
from pipeline.commands.tradeoff import TIMED
from pipeline.core.tradeoff import Trial
from pipeline.report import style
from pipeline.report.figures import draw_tradeoff

DOCS = Path(__file__).resolve().parents[2] / "docs"
PLASTIC, GOURD = ("plastic", "teapot-plastic"), ("gourd", "gourd")
HEAD = """# What accuracy costs, stage by stage

![Error against seconds of six stages](tradeoff.png)

Printed by `python tests/benchmarks/tradeoff_table.py --cache FOLDER --write` on {cores} processor cores, {day}. Filled
points are the best for their time; open ones are beaten, as the last column says. `lightsphere tradeoff` makes such a
table and plot for a scene, capture, shape or reflectance of yours.
"""


def main() -> None:
    """Measure all stages; print and, if asked, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="folder of captures and results")
    parser.add_argument("--write", action="store_true", help="replace docs/tradeoff.md and docs/tradeoff.png")
    chosen = parser.parse_args()
    cache = chosen.cache
    for name, scene in (PLASTIC, GOURD):
        made(cache / name, "capture", scene, "--effects", "direct", file="capture.json")
        made(cache / f"{name}_shape", "shape", str(cache / name), file="shape.json")
    made(cache / "gourd_tables", "reflectance", str(cache / "gourd_shape"), file="reflectance.json")
    photograph = cache / "desk_room.exr"
    if not photograph.is_file():
        cli.main(["scenes", "--photograph", "desk-room", "-o", str(photograph)])
    asked = (
        ("capture", "the plastic teapot on its ground", ["teapot-plastic"]),
        ("shape", "the plastic teapot, 320/80 lights, 100x100", [str(cache / "plastic")]),
        ("reflectance", "the gourd of three materials", [str(cache / "gourd_shape"), "--stage", "reflectance"]),
        ("material", "the gourd's three tables", [str(cache / "gourd_tables")]),
        ("relight", "the plastic teapot", [str(cache / "plastic_shape"), "--stage", "relight"]),
        ("inverse", "the desk room, one photograph", ["desk-room", "--photograph", str(photograph)]),
    )
    pages, figure = [], Figure(figsize=(11.5, 10.5))
    figure.subplots_adjust(hspace=0.42, wspace=0.3)
    for place, (stage, what, words) in enumerate(asked, start=1):
        rows = measured(cache, stage, words)
        axes = figure.add_subplot(3, 2, place)
        axes.set_title(f"{stage}: {what}", fontsize=9.5, loc="left")
        draw_tradeoff(axes, [trial_of(row) for row in rows], TIMED[stage])
        pages.append(page(stage, what, rows))
    text = HEAD.format(cores=os.cpu_count(), day=date.today().isoformat()) + "".join(pages)
    print(text)
    if chosen.write:
        (DOCS / "tradeoff.md").write_text(text, encoding="utf-8")
        (DOCS / "tradeoff.png").write_bytes(style.plot_png(figure, dpi=110))


def made(folder: Path, *words: str, file: str) -> None:
    """Run a stage where its folder does not hold its result."""
    if not (folder / file).is_file():
        assert cli.main([*words, "-o", str(folder)]) == 0


def measured(cache: Path, stage: str, words: list[str]) -> list[dict[str, object]]:
    """Return the rows of a stage's table."""
    figures = cache / f"{stage}.json"
    assert (
        cli.main(["tradeoff", *words, "-o", str(cache / f"tradeoff_{stage}"), "--overwrite", "--json", str(figures)])
        == 0
    )
    rows: list[dict[str, object]] = json.loads(figures.read_text(encoding="utf-8"))["trials"]
    return rows


def trial_of(row: dict[str, object]) -> Trial:
    """Return a row as a trial again."""
    errors = {name: value for name, value in row.items() if isinstance(value, float) and name != "seconds"}
    return Trial(str(row["label"]), {}, float(str(row["seconds"])), errors)


def page(stage: str, what: str, rows: list[dict[str, object]]) -> str:
    """Return a stage's table in Markdown."""
    trials = [trial_of(row) for row in rows]
    names = [trials[0].error, *(name for name in ("recovered_pct",) if name in trials[0].errors)]
    lines = [f"\n## {stage.capitalize()}: {what}\n", f"| settings | {TIMED[stage]} | {' | '.join(names)} | beaten by |"]
    lines.append("|---" * (len(names) + 3) + "|")
    for row, trial in zip(rows, trials, strict=True):
        values = " | ".join(f"{trial.errors[name]:.3g}" for name in names)
        lines.append(f"| {trial.label} | {trial.seconds:.3g} | {values} | {row['beaten_by'] or ''} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
