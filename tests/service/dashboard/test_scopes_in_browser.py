"""A key shows everything, and only the buttons that it may use."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from service.dashboard.panel_place import set_up_place
from service.dashboard.test_room_in_browser import with_a_plan
from support.browser import open_page

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(("scope", "edits", "deletes"), [(Scope.READ, 0, 0), (Scope.WRITE, 1, 0), (Scope.ADMIN, 1, 1)])
def test_a_key_shows_plans_zones_and_settings_and_only_the_buttons_that_it_may_use(
    chromium: Browser, tmp_path: Path, scope: Scope, edits: int, deletes: int
) -> None:
    keys = ApiKeys(tmp_path)
    secret = keys.add("somebody", scope)
    with set_up_place(with_a_plan(), Authenticator({SOURCE: keys})) as place, open_page(chromium, place.url) as watched:
        page = watched.page

        def offered(**buttons: int) -> None:
            """Wait until so many buttons have these names, in which an underscore stands for a space."""
            for name, count in buttons.items():
                expect(page.get_by_role("button", name=name.replace("_", " "))).to_have_count(count)

        page.locator("#key").fill(secret)
        page.get_by_role("button", name="Open").click()
        watched.wait_for("dropanchor.plans()[0]?.isReady && dropanchor.events() && 'yard' in dropanchor.zones()")
        offered(Set_up_floor_plans=edits, Set_up_anchors=edits)
        page.locator("#zone-list summary").click()
        expect(page.locator("#zone-list li")).to_have_count(1)
        offered(New_polygon=edits, Edit=edits)
        page.locator("tr[data-tag='cart-3']").click()
        settings = page.locator("#detail .settings > summary")
        expect(settings).to_be_visible(visible=bool(edits))
        if not edits:
            return
        settings.click()
        offered(Save_settings=1, Delete_tag=deletes)
        page.get_by_role("button", name="Edit Yard 10").click()
        offered(Save_zone=1, Delete=deletes)
        page.get_by_role("button", name="Set up floor plans").click()
        page.get_by_role("button", name="hall").click()
        offered(Save_plan=1, Delete=deletes)
