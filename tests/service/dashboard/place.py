"""The real interface with the page, over a store that a test fills."""

import time
from dataclasses import dataclass
from typing import Any

from api_house import House, make_house
from dropanchor_schemas.site import Site


@dataclass
class Place:
    house: House
    url: str

    def move(self, *names: str, **fields: Any) -> None:
        self.house.move(*names, **({"t_ns": time.time_ns()} | fields))


def live_house(site: Site | None = None) -> House:
    house = make_house(site)
    house.answers.now_ns = time.time_ns
    return house
