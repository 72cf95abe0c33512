"""A served page with floor plans."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dropanchor_schemas.plans import Floor, Placement, Plan
from dropanchor_schemas.site import Site
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.plans.floors import follow_floors
from dropanchor_service.plans.reading.file_types import file_type_of
from dropanchor_service.plans.reading.messages import Request
from dropanchor_service.plans.reading.read_plan import read_plan
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.security.identity import Authenticator
from service.dashboard.place import Place, live_api_bench
from support.http_server import running_server


@dataclass
class PlanPlace(Place):
    """plans: what the interface reads and changes."""

    plans: PlanStore

    def put(self, plan: str, content: bytes, m_per_px: float = 0.05, floor: Floor | None = None, **fields: Any) -> Plan:
        """Put a plan of this file with its centre at the origin."""
        image = self.plans.add_image(read_plan(content, Request(media_type=file_type_of(content, ""))))
        made = Plan(id=plan, image=image, placement=Placement(x=0, y=0, m_per_px=m_per_px), floor=floor, **fields)
        self.plans.put(plan, made)
        return made


@contextmanager
def plan_place(
    site: Site | None = None, folder: Path | None = None, authenticator: Authenticator | None = None
) -> Iterator[PlanPlace]:
    """Serve a page until the block ends."""
    bench, plans = live_api_bench(site), PlanStore(folder)
    follow_floors(plans, bench.answers.site)
    app = bench.app(DASHBOARD, plans=plans, authenticator=authenticator)
    with running_server(app, bench.stopping) as port:
        yield PlanPlace(bench, f"http://127.0.0.1:{port}/", plans)
