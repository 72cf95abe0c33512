"""The real REST API and page over a store that the test fills."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dropanchor_schemas.site import Site
from dropanchor_service.history.storage import Retention
from support.api import ApiBench, make_api_bench

FRESH_NS = 600_000_000_000


@dataclass
class Place:
    """A served page: its address, and the bench behind it."""

    bench: ApiBench
    url: str

    def move(self, *names: str, **fields: Any) -> None:
        """Give each named tag a new pose of now, with the given fields of POSE. It stays fresh: a page takes long."""
        self.bench.move(*names, **({"t_ns": time.time_ns() + FRESH_NS} | fields))


def live_api_bench(
    site: Site | None = None, folder: Path | None = None, retention: Retention | None = None
) -> ApiBench:
    """Return a bench on the clock of the host. folder, retention: see `make_api_bench`."""
    bench = make_api_bench(site, folder, retention)
    bench.answers.now_ns = time.time_ns
    return bench
