"""The real interface with the page, over a store that a test fills."""

import time
from dataclasses import dataclass
from typing import Any

from dropanchor_schemas.site import Site
from support.api import ApiBench, make_api_bench


@dataclass
class Place:
    bench: ApiBench
    url: str

    def move(self, *names: str, **fields: Any) -> None:
        self.bench.move(*names, **({"t_ns": time.time_ns()} | fields))


def live_api_bench(site: Site | None = None) -> ApiBench:
    bench = make_api_bench(site)
    bench.answers.now_ns = time.time_ns
    return bench
