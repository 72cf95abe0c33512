"""The poses that tags of many sites would have if nothing had ever happened to the service."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.cached_tags import LONGEST_S, MOTIONS, payload_of
from benchmarks.motion import tracks
from benchmarks.site_accounts import Accounts
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.settings.sources import load_settings
from support.ingest import IngestBench


class Undisturbed:
    """One service, with the first tag of each site. start_ns: UTC of the first message."""

    def __init__(self, accounts: Accounts, start_ns: int, folder: Path) -> None:
        self._firsts = accounts.first_tags()
        self._tags = accounts.tags_in_all
        self._motions = tracks(LONGEST_S, MOTIONS)
        self._start_ns = start_ns
        self._done = 0
        file = folder / "undisturbed.toml"
        tables = [line for site, tag in self._firsts.items() for line in (f'[tags."{site}"]', accounts.start_of(tag))]
        file.write_text("\n".join(["[[site.anchors]]", 'id = "1"', *tables]) + "\n")
        settings = load_settings(file, environment={})
        self._bench = IngestBench(engine=create_engine(settings), site=settings.site, tags=settings.tags)

    def poses_after(self, numbers: Sequence[int]) -> dict[str, Any]:
        """Return the pose of the first tag of each site. numbers: of the messages that every tag has sent so far."""
        for sequence in range(self._done, len(numbers)):
            for site, tag in self._firsts.items():
                payload = payload_of(self._motions, tag, self._tags, sequence, numbers[sequence], self._start_ns)
                self._bench.put(site, payload)
            self._bench.ingest.turn()
        self._done = len(numbers)
        return {tag.name: self._bench.latest.row(tag.row) for tag in self._bench.tags.all()}
