"""Let a site know the floors of its plans."""

from dropanchor_service.plans.store import PlanStore
from dropanchor_service.store.floors import floors_of
from dropanchor_service.store.site import SiteStore


def follow_floors(plans: PlanStore, site: SiteStore) -> None:
    """Keep the floors of the site those of its plans, from now on."""

    def follow() -> None:
        site.floors = floors_of(plan.floor for plan in plans.all.values())

    plans.on_change.append(follow)
    follow()
