"""The catalogue of hard cases: a file a case, whose docstring says what it is, why it is hard, and what must come out.

A case's ``run`` gives outcomes; each is a line of docs/hard_cases.md, which this module writes, and a test::

    python tests/hard_cases/catalogue.py [--write]
"""

from __future__ import annotations

import argparse
import importlib
import math
import pkgutil
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))

HEAD = """# Hard cases

Printed by `python tests/hard_cases/catalogue.py --write`, which runs every case of `tests/hard_cases/`: what makes it
hard, the error of the result, the error that is allowed, and what the product did. The same runs as a test.
"""


@dataclass(frozen=True)
class Outcome:
    """What came out of a case under one condition.

    Parameters
    ----------
    condition : str
        How hard it was, in numbers.
    error, bound : float
        What came out and the most that is allowed; both 0 where all that counts is what was done.
    unit : str
        What the error is.
    did : str
        What the product did: solved it, lowered its confidence, or said what is wrong.
    """

    condition: str
    error: float
    bound: float
    unit: str
    did: str

    @property
    def holds(self) -> bool:
        """Whether the error is a number within its bound."""
        return math.isfinite(self.error) and self.error <= self.bound


def cases() -> list[ModuleType]:
    """Return the modules of all cases, by name."""
    names = sorted(m.name for m in pkgutil.iter_modules([str(HERE)]) if m.name not in (Path(__file__).stem,))
    return [importlib.import_module(f"tests.hard_cases.{name}") for name in names if not name.startswith("test_")]


def title(case: ModuleType) -> str:
    """Return the first line of a case's docstring."""
    return (case.__doc__ or "").strip().splitlines()[0].rstrip(".")


def table() -> str:
    """Run all cases; return the page."""
    lines = [HEAD, "| case | condition | error | allowed | of | what the product did |", "|---|---|---|---|---|---|"]
    for case in cases():
        for number, one in enumerate(case.run()):
            numbers = f"{one.error:.2g} | {one.bound:.2g}" if one.bound else " | "
            lines.append(
                f"| {title(case) if not number else ''} | {one.condition} | {numbers} | {one.unit} | {one.did} |"
            )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the page and, if asked, write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="replace docs/hard_cases.md")
    write = parser.parse_args().write
    text = table()
    print(text)
    if write:
        (HERE.parents[1] / "docs" / "hard_cases.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
