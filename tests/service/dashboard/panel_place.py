"""A served page on which everything can be set up: anchors, tags, plans, zones, rules and destinations."""

from collections.abc import Iterator
from contextlib import contextmanager

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.security.identity import Authenticator
from service.dashboard.alert_place import alert_place, put_mail
from service.dashboard.zone_place import ZonePlace
from support.http_server import running_server


@contextmanager
def set_up_place(plans: PlanStore | None = None, authenticator: Authenticator | None = None) -> Iterator[ZonePlace]:
    """Serve the place until the block ends, with a zone, a destination and the tag `cart-3`."""
    place = alert_place()
    put_mail(place)
    place.go("cart-3", 2.0, 2.0)
    app = place.bench.app(DASHBOARD, authenticator=authenticator, events=place.parts, plans=plans or PlanStore(None))
    with running_server(app, place.bench.stopping) as port:
        place.url = f"http://127.0.0.1:{port}/"
        yield place
