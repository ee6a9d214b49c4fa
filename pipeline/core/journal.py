"""A list of finished files that survives a killed process: one line each, in the format of ``sha256sum``."""

from __future__ import annotations

from pathlib import Path

from .errors import LightsphereError


class Journal:
    """The finished files of a folder and their SHA-256, appended as each is done.

    A line that a killed process left unfinished is ignored: that file counts as not done.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> dict[str, str]:
        """Return the checksum of every finished file by name."""
        if not self.path.is_file():
            return {}
        lines = self.path.read_text(encoding="utf-8", errors="replace").split("\n")[:-1]
        found = (line.split("  ", 1) for line in lines)
        return {words[1]: words[0] for words in found if len(words) == 2 and len(words[0]) == 64}

    def add(self, file: str, checksum: str) -> None:
        """Append one finished file; raise LightsphereError when the disk is full."""
        try:
            with self.path.open("a", encoding="utf-8", newline="\n") as stream:
                stream.write(f"{checksum}  {file}\n")
        except OSError as error:
            raise LightsphereError(f"{self.path} cannot be written ({error}); free space and run again") from error

    def remove(self) -> None:
        """Delete the journal, once its content is recorded elsewhere."""
        self.path.unlink(missing_ok=True)
