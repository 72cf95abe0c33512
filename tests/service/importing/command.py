"""Call `dropanchor import` as a user does."""

import csv
from pathlib import Path
from typing import NamedTuple

import pytest

from dropanchor_service.cli import main


class Ended(NamedTuple):
    """out: the folder of the recording."""

    status: int
    printed: str
    error: str
    out: Path

    def rows(self, name: str) -> list[dict[str, str]]:
        with (self.out / f"{name}.csv").open(newline="") as file:
            return list(csv.DictReader(file))

    def column(self, name: str, column: str) -> list[float]:
        return [float(row[column]) for row in self.rows(name)]


class Import:
    """Imports into the folder `out`."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self._capsys = folder, capsys

    def __call__(self, *arguments: str | Path, out: str = "out", imu: bool = False) -> Ended:
        """imu: whether it is needed."""
        self._capsys.readouterr()
        folder = self.folder / out
        status = main(["import", *map(str, arguments), "--out", str(folder), *([] if imu else ["--without-imu"])])
        printed, error = self._capsys.readouterr()
        return Ended(status, printed, error, folder)

    def file(self, name: str, content: str | bytes) -> Path:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path
