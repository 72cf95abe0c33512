"""What a person does on the page is said, undone and done again, whatever has the focus."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, Route, expect

from dropanchor_schemas.destinations import WebhookDestination
from dropanchor_schemas.site import Anchor, TagSettings
from dropanchor_schemas.zones import Polygon
from service.dashboard.alert_place import SECRET, alert_place, put_mail
from service.dashboard.zone_place import ZonePlace, disc, served, square
from support.browser import WatchedPage, drag, watched_page
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser

ZONES = re.compile(r"/api/v1/zones(/ramp)?$")


@pytest.fixture
def yard() -> Iterator[ZonePlace]:
    place = alert_place()
    place.put(square("ramp", 1.0, 1.0, name="Ramp"), disc("dock", -3.0, 0.0, 1.5, name="Dock"))
    place.move("cart", "van", x=[-4.0, -2.0], y=-4.0)
    with served(place):
        yield place


def outcome_of(page: WatchedPage) -> Locator:
    return page.page.locator("#outcome")


def said(outcome: Locator, sentence: str) -> None:
    """Wait until the message begins with a sentence."""
    expect(outcome).to_have_text(re.compile(f"^{re.escape(sentence)}"))


def corner_of(place: ZonePlace, zone: str) -> list[float]:
    shape = place.zones[zone].shape
    assert isinstance(shape, Polygon)
    return shape.points[0]


def test_zones_are_undone_step_by_step_while_they_are_drawn_and_after_they_are_saved(
    chromium: Browser, yard: ZonePlace
) -> None:
    with watched_page(chromium, yard.url) as watched:
        page, outcome = watched.page, outcome_of(watched)
        watched.wait_for("dropanchor.events() && 'ramp' in dropanchor.zones()")
        watched.wait_for_map(2)
        page.locator("#zone-list summary").click()
        form = page.get_by_role("form", name="Zone", exact=True)

        page.get_by_role("button", name="Edit Ramp").click()
        corner = page.get_by_role("button", name="Corner 1 of 4")
        before = corner.get_attribute("aria-label") or ""
        drag(page, corner, -40, 20)
        expect(corner).not_to_have_attribute("aria-label", before)
        said(outcome, "Corner moved. Not saved yet.")
        page.keyboard.press("Control+z")  # the corner has the focus
        expect(corner).to_have_attribute("aria-label", before)
        said(outcome, "Undone: Corner moved.")
        page.keyboard.press("Control+Shift+Z")
        expect(corner).not_to_have_attribute("aria-label", before)
        form.get_by_role("button", name="Save zone").click()
        said(outcome, "Shape of zone Ramp changed.")
        expect(form).to_be_hidden()
        assert corner_of(yard, "ramp") != [1.0, 1.0]
        page.keyboard.press("Control+z")  # nothing has the focus
        said(outcome, "Undone: Shape of zone Ramp changed.")
        assert corner_of(yard, "ramp") == [1.0, 1.0]

        page.get_by_role("button", name="Edit Ramp").click()
        name = form.get_by_label("Name")
        name.press_sequentially("2")
        name.press("Control+z")
        expect(name).to_have_value("Ramp")  # the field undoes its own typing
        name.fill("Gate")
        name.press("Enter")
        said(outcome, "Zone Ramp renamed to Gate.")
        expect(form).to_be_hidden()
        page.get_by_role("button", name="Edit Gate").click()
        name.press("Control+z")  # nothing is typed in the field
        said(outcome, "Undone: Zone Ramp renamed to Gate.")
        expect(name).to_have_value("Ramp")

        held = list[Route]()
        page.route(ZONES, lambda route: held.append(route) if route.request.method == "GET" else route.continue_())
        form.get_by_role("button", name="Delete…").click()
        form.get_by_role("button", name="Delete zone").click()
        said(outcome, "Zone Ramp deleted.")
        assert "ramp" not in yard.zones
        page.get_by_label("Filter tags by name").press("Control+z")  # before the page has read the zones again
        said(outcome, "Undone: Zone Ramp deleted.")
        assert corner_of(yard, "ramp") == [1.0, 1.0]
        for read in held:
            read.continue_()
        page.unroute(ZONES)

        page.get_by_role("button", name="New polygon").click()
        for x, y in ((200, 300), (320, 300), (320, 400)):
            page.locator("#map").click(position={"x": x, "y": y})
        expect(page.get_by_role("button", name="Corner 3 of 3")).to_be_attached()
        outcome.get_by_role("button", name="Undo").click()
        expect(page.get_by_role("button", name="Corner 2 of 2")).to_be_attached()
        page.locator("#map").click(position={"x": 320, "y": 420})
        form.get_by_label("Name").fill("Pit")
        form.get_by_label("Name").press("Enter")
        said(outcome, "Zone Pit added.")
        outcome.get_by_role("button", name="Undo").press("Enter")
        expect(outcome.get_by_role("button", name="Redo")).to_be_focused()
        assert set(yard.zones) == {"yard", "ramp", "dock"}
        page.keyboard.press("Enter")
        said(outcome, "Zone Pit added.")
        assert "pit" in yard.zones

        page.get_by_role("button", name="Edit Dock").click()
        drag(page, page.get_by_role("button", name="Centre"), 30, 0)
        form.get_by_role("button", name="Save zone").click()
        said(outcome, "Zone Dock moved.")
        expect(form).to_be_hidden()  # what was drawn in it can be undone until then
        yard.put(disc("dock", 7.0, 7.0, 1.0, name="Theirs"))
        page.keyboard.press("Control+z")
        said(outcome, "Not undone, because somebody changed it since: Zone Dock moved.")
        assert yard.zones["dock"].name == "Theirs"
        page.keyboard.press("Control+z")
        said(outcome, "Undone: Zone Pit added.")
        outcome.get_by_role("button", name="Close").click()
        expect(outcome).to_have_text("")
        expect(page.get_by_role("status").and_(outcome)).to_be_attached()  # so that the next message is heard
        assert all("412" in error for error in watched.errors)


def test_rules_destinations_tags_and_anchors_are_undone(chromium: Browser, yard: ZonePlace) -> None:
    put_mail(yard)
    yard.parts.destinations.put(
        "mes", WebhookDestination(type="webhook", id="mes", url="http://127.0.0.1:9/a", secret=SECRET)
    )
    site, destinations, rules = yard.bench.answers.site, yard.parts.destinations, yard.parts.items.rules
    site.set_anchor(Anchor(id="17", x=3.0, y=2.0, z=1.0))
    with watched_page(chromium, yard.url) as watched:
        page, outcome = watched.page, outcome_of(watched)
        watched.wait_for("dropanchor.events() && 'ramp' in dropanchor.zones()")
        page.locator("#alerts summary").click()
        alerts = page.locator("#alerts")

        alerts.get_by_role("button", name="New: Tags too close").click()
        rule = alerts.get_by_role("form", name="Rule", exact=True)
        rule.get_by_label("Name").fill("Apart")
        rule.get_by_role("button", name="Save rule").click()
        said(outcome, "Rule Apart added.")
        alerts.get_by_role("button", name="Edit Apart").click()
        rule.get_by_label("Closer than").fill("5")
        rule.get_by_label("Closer than").press("Enter")
        said(outcome, "Rule Apart changed.")
        page.keyboard.press("Control+z")
        said(outcome, "Undone: Rule Apart changed.")
        assert rules.all["apart"].model_dump()["distance_m"] == 3.0
        expect(alerts).to_contain_text("Closer than 3 m")
        alerts.get_by_role("button", name="Edit Apart").click()
        rule.get_by_role("button", name="Delete…").click()
        page.get_by_role("button", name="Delete rule").click()
        said(outcome, "Rule Apart deleted.")
        outcome.get_by_role("button", name="Undo").click()
        said(outcome, "Undone: Rule Apart deleted.")
        assert "apart" in rules.all

        form = alerts.get_by_role("form", name="Destination", exact=True)
        alerts.get_by_role("button", name="Edit mes").click()
        form.get_by_role("button", name="Delete…").click()
        page.get_by_role("button", name="Delete destination").click()
        said(outcome, "Destination mes deleted. It still gets events for 20 s.")
        expect(alerts).to_contain_text("Being deleted.")
        page.keyboard.press("Control+z")
        said(outcome, "Undone: Destination mes deleted.")
        kept = destinations.all["mes"]
        assert isinstance(kept, WebhookDestination)
        assert (kept.url, kept.secret) == ("http://127.0.0.1:9/a", SECRET)
        alerts.get_by_role("button", name="Edit mes").click()
        form.get_by_label("URL").fill("http://127.0.0.1:9/b")
        form.get_by_role("button", name="Save destination").click()
        said(outcome, "Destination mes changed. This cannot be undone")
        expect(outcome.get_by_role("button", name="Undo")).to_have_count(0)
        page.keyboard.press("Control+z")
        said(outcome, "This cannot be undone")
        alerts.get_by_role("button", name="Edit shift").click()
        form.get_by_label("New events go there").uncheck()
        form.get_by_role("button", name="Save destination").click()
        said(outcome, "Destination shift changed.")
        page.keyboard.press("Control+z")
        said(outcome, "Undone: Destination shift changed.")
        assert destinations.all["shift"].enabled

        page.locator("tr[data-tag='cart']").click()
        page.locator("#detail .settings > summary").click()
        settings = page.get_by_role("form", name="Settings of the tag")
        expect(settings.locator("[name=height_m]")).to_have_attribute("data-shown", "0")
        settings.get_by_label("Name").fill("Forklift 1")
        settings.get_by_label("Group").fill("forklifts")
        settings.get_by_label("Group").press("Enter")
        said(outcome, "Settings of cart changed.")
        settings.get_by_label("Group").press("Control+z")  # what was typed there is saved
        said(outcome, "Undone: Settings of cart changed.")
        assert site.tag_settings("cart") == TagSettings()
        settings.get_by_label("Moved by").press("Control+Shift+Z")
        said(outcome, "Settings of cart changed.")
        page.get_by_role("button", name="The tag is here…").click()
        page.get_by_role("button", name="Set start").click()
        said(outcome, "Start of cart set.")
        yard.move("cart", x=9.0, y=9.0)
        watched.wait_for("dropanchor.trail('cart').includes(9)")
        yard.move("cart", x=5.0, y=5.0)
        watched.wait_for("dropanchor.tags().some(({ tag, x }) => tag === 'cart' && x === 5)")
        settings.get_by_label("Colour").press("Control+z")
        said(outcome, "Undone: Start of cart set.")
        watched.wait_for("!dropanchor.trail('cart').includes(9)")
        assert site.tag_settings("cart") == TagSettings(name="Forklift 1", group="forklifts")
        settings.get_by_role("button", name="Delete tag…").click()
        page.get_by_role("dialog").get_by_role("button", name="Delete").click()
        said(outcome, "Tag cart deleted.")
        page.keyboard.press("Control+z")
        said(outcome, "Undone: Tag cart deleted.")
        assert site.tag_settings("cart").name == "Forklift 1"

        page.get_by_role("button", name="Set up anchors").click()
        page.get_by_role("button", name="17:").click()
        page.get_by_role("button", name="Delete…").last.click()
        page.get_by_role("dialog").get_by_role("button", name="Delete").click()
        said(outcome, "Anchor 17 deleted.")
        page.get_by_role("button", name="Set up anchors").press("Meta+z")
        said(outcome, "Undone: Anchor 17 deleted.")
        assert "17" in {anchor.id for anchor in site.site.anchors}
        assert watched.errors == []


def test_a_destination_is_deleted_when_nobody_can_undo_it_any_longer(chromium: Browser, yard: ZonePlace) -> None:
    put_mail(yard)
    with watched_page(
        chromium, yard.url, locale="de-DE", size=(390, 844), prepare=lambda page: page.clock.install()
    ) as watched:
        page, outcome = watched.page, outcome_of(watched)
        watched.wait_for("dropanchor.events()")
        page.locator("#alerts summary").click()
        page.get_by_role("button", name="shift bearbeiten").click()
        page.locator("#alerts form:not([hidden])").get_by_role("button", name="Löschen …").click()
        page.get_by_role("button", name="Ziel löschen").click()
        said(outcome, "Ziel shift gelöscht. Noch 20 s lang bekommt es Ereignisse.")
        assert "shift" in yard.parts.destinations.all
        page.clock.fast_forward(21_000)
        wait_until(lambda: "shift" not in yard.parts.destinations.all)
        expect(outcome).to_have_text("")
        assert watched.errors == []
