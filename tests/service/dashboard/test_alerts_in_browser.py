"""Destinations and rules are made, edited, tested and deleted on the page."""

import ipaddress
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, Route, expect

from dropanchor_schemas.destinations import EmailDestination, MqttPosesDestination, WebhookDestination
from dropanchor_schemas.zones import BatteryLowRule, Severity, TooCloseRule
from dropanchor_service.delivery.signature import key_of
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.settings.events import EmailSettings
from service.dashboard.alert_place import SECRET, alert_place, happen, put_mail
from service.dashboard.zone_place import ZonePlace, served
from support.browser import WatchedPage, open_page, watched_page
from support.mail_server import MailServer, running_mail_server
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser


def opened(page: WatchedPage) -> Locator:
    """Open the alerts, once they are loaded."""
    page.wait_for("dropanchor.events()")
    page.page.locator("#alerts summary").click()
    alerts = page.page.locator("#alerts")
    expect(alerts.get_by_role("list", name="Rules").get_by_text("Yard 10")).to_be_visible()
    return alerts


def test_an_e_mail_is_made_tested_edited_and_deleted(chromium: Browser) -> None:
    server = MailServer()
    place = alert_place(EmailSettings(server="127.0.0.1", port=server.port, tls="none"))
    with running_mail_server(server), served(place), watched_page(chromium, place.url) as page:
        alerts = opened(page)
        expect(alerts.locator("summary")).to_contain_text("nobody is told yet")
        alerts.get_by_role("button", name="New e-mail").click()
        form = alerts.get_by_role("form", name="Destination", exact=True)
        expect(form.get_by_label("Name")).to_be_focused()
        form.get_by_label("Name").fill("Early shift")
        form.get_by_label("Addresses").fill("shift@example.com, lead@example.com")
        expect(form.get_by_label("Mails in")).to_have_value("en")
        form.get_by_label("Mails in").select_option("Deutsch")
        form.get_by_label("Too long in a zone").check()
        form.get_by_label("Zones").fill("yard")
        form.get_by_role("button", name="Save destination").click()
        expect(form).to_be_hidden()
        made = place.parts.destinations.all["early-shift"]
        assert isinstance(made, EmailDestination)
        assert made.to == ["shift@example.com", "lead@example.com"]
        assert (made.types, made.zones, made.digest_s) == (["dropanchor.zone.dwell"], ["yard"], 60.0)
        alerts.get_by_role("button", name="Test early-shift").click()
        expect(alerts).to_contain_text("The test event was delivered: the mail server answered")
        assert "Dies ist ein Test des Ziels early-shift" in server.mails[0]["Subject"]
        alerts.get_by_role("button", name="Edit early-shift").click()
        expect(form.get_by_label("Name")).to_be_hidden()
        expect(form.get_by_label("Addresses")).to_have_value("shift@example.com, lead@example.com")
        expect(form.get_by_label("Too long in a zone")).to_be_checked()
        form.get_by_label("New events go there").uncheck()
        form.get_by_role("button", name="Save destination").click()
        expect(alerts.get_by_role("list", name="Destinations")).to_contain_text("off")
        alerts.get_by_role("button", name="Edit early-shift").click()
        form.get_by_role("button", name="Delete…").click()
        page.page.get_by_role("button", name="Delete destination").click()
        expect(alerts.get_by_role("button", name="Edit early-shift")).to_be_hidden()
        page.wait_for("history.state?.is !== 'above'")  # the page goes back by itself once nothing is open
        page.page.reload()  # the time to undo is over with the page
        expect(alerts.locator("summary")).to_contain_text("nobody is told yet")
        assert page.errors == []
    assert not place.parts.destinations.all


def test_a_webhook_needs_no_terminal_its_secret_is_made_and_its_network_allowed_where_it_is_refused(
    chromium: Browser,
) -> None:
    place = alert_place(EmailSettings())
    with served(place), watched_page(chromium, place.url) as page:
        page.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        alerts = opened(page)
        alerts.get_by_role("button", name="New e-mail").click()
        expect(alerts.get_by_role("alert")).to_contain_text("An e-mail needs a mail server")
        expect(alerts.get_by_role("form", name="Destination", exact=True)).to_be_hidden()
        alerts.get_by_role("button", name="New webhook").click()
        form = alerts.get_by_role("form", name="Destination", exact=True)
        form.get_by_label("Name").fill("mes")
        form.get_by_label("URL").fill("http://10.0.0.1/events")
        secret = form.get_by_role("textbox", name="Secret").input_value()
        key_of(secret)
        form.get_by_role("button", name="Copy").click()
        page.wait_for(f"navigator.clipboard.readText().then((text) => text === {secret!r})")
        form.get_by_role("button", name="New secret").click()
        assert form.get_by_role("textbox", name="Secret").input_value() != secret
        form.get_by_role("textbox", name="Secret").fill("")
        expect(form.get_by_role("button", name="Copy")).to_be_hidden()
        assert is_marked(form.get_by_role("textbox", name="Secret"))
        assert is_marked(form.get_by_label("URL"))
        assert not is_marked(form.get_by_role("textbox", name="Tags"))
        form.get_by_role("textbox", name="Secret").fill(SECRET)
        form.get_by_role("button", name="Save destination").click()
        expect(form.get_by_role("alert")).to_have_text(
            "This receiver is inside, in 10.0.0.0/24, where events may not go yet."
        )
        expect(form.get_by_role("textbox", name="Secret")).to_have_value(SECRET)
        form.get_by_role("button", name="Allow 10.0.0.0/24").click()
        expect(form).to_be_hidden()
        networks = alerts.get_by_role("list", name="Receivers inside")
        expect(networks).to_contain_text("127.0.0.0/8in the settings10.0.0.0/24")
        kept = place.parts.destinations.all["mes"]
        assert isinstance(kept, WebhookDestination)
        assert (kept.secret, kept.url) == (SECRET, "http://10.0.0.1/events")
        alerts.get_by_role("button", name="Edit mes").click()
        expect(form.get_by_role("textbox", name="Secret")).to_have_value("")
        assert not is_marked(form.get_by_role("textbox", name="Secret"))
        expect(form).to_contain_text("The present one stays, and cannot be shown.")
        form.get_by_role("textbox", name="Tags").fill("cart-3")
        form.get_by_role("button", name="Save destination").click()
        expect(form).to_be_hidden()
        kept = place.parts.destinations.all["mes"]
        assert isinstance(kept, WebhookDestination)
        assert (kept.secret, kept.tags) == (SECRET, ["cart-3"])
        alerts.get_by_label("Network", exact=True).fill("169.254.0.0/16")
        alerts.get_by_role("button", name="Allow network").click()
        expect(alerts.get_by_role("alert")).to_contain_text("169.254.0.0/16 is not private")
        alerts.get_by_role("button", name="Remove 10.0.0.0/24").click()
        expect(networks.get_by_text("10.0.0.0/24")).to_be_hidden()
        assert list(place.parts.channels.networks) == [ipaddress.ip_network("127.0.0.0/8")]


def is_marked(field: Locator) -> bool:
    """Return whether a field is said to be needed, to the eye and by a screen reader."""
    marked = field.evaluate("field => getComputedStyle(field.closest('label'), '::before').content.includes('*')")
    assert field.evaluate("field => field.required") == marked
    return bool(marked)


def test_dead_letters_are_shown_sent_again_and_dropped(chromium: Browser) -> None:
    place = alert_place()
    put_mail(place)
    happen(place, "cart-3", "cart-4")
    place.parts.deliveries.bury("shift", [1, 2], "the mail server answered 550 no such user")
    with served(place), watched_page(chromium, place.url) as page:
        alerts = opened(page)
        expect(alerts.locator("summary")).to_contain_text("2 events could not be delivered")
        alerts.get_by_role("button", name="Show what shift did not get").click()
        letters = alerts.get_by_role("list", name="Events that were not delivered")
        expect(letters).to_contain_text("cart-3 entered Yard 10: the mail server answered 550 no such user")
        alerts.get_by_role("button", name="Send again what shift did not get").click()
        expect(alerts.get_by_role("list", name="Destinations")).to_contain_text("2 events waiting")
        place.parts.deliveries.bury("shift", [1], "refused")
        alerts.get_by_role("button", name="Drop what shift did not get").click()
        page.page.get_by_role("button", name="Drop", exact=True).last.click()
        wait_until(lambda: place.parts.deliveries.states()["shift"][:2] == (1, 0))
        expect(alerts.get_by_role("list", name="Destinations").get_by_text("1 event waiting")).to_be_visible()
        check_poses(place, alerts)


def check_poses(place: ZonePlace, alerts: Locator) -> None:
    """Make a destination of poses, which has no events to choose."""
    alerts.get_by_role("button", name="Poses by MQTT").click()
    form = alerts.get_by_role("form", name="Destination", exact=True)
    expect(form.get_by_label("Too long in a zone")).to_be_hidden()
    form.get_by_label("Name").fill("House")
    form.get_by_label("Moved by at least").fill("0.5")
    form.get_by_label("Home Assistant looks below").fill("")
    form.get_by_role("button", name="Save destination").click()
    expect(alerts.get_by_role("list", name="Destinations")).to_contain_text("poses in the MQTT topics dropanchor/…")
    made = place.parts.destinations.all["house"]
    assert isinstance(made, MqttPosesDestination)
    assert (made.deadband_m, made.interval_s, made.discovery, made.enabled) == (0.5, 1.0, "", True)


def with_another_rule(page: Page) -> None:
    """Let the page hear of a rule that its code does not know, and not at once of what it may do."""

    def answer(route: Route) -> None:
        schema = route.fetch().json()
        schema["$defs"]["ParkedRule"] = schema["$defs"]["LostRule"]
        schema["discriminator"]["mapping"]["parked"] = "#/$defs/ParkedRule"
        route.fulfill(json=schema)

    page.route("**/schemas/event_rule.json", answer)
    page.route("**/api/v1/access", lambda route: route.abort(), times=5)


def test_rules_are_made_and_edited_and_those_of_zones_lead_to_the_zone(chromium: Browser) -> None:
    place = alert_place()
    with served(place), watched_page(chromium, place.url, prepare=with_another_rule) as page:
        alerts = opened(page)
        expect(alerts.get_by_role("list", name="Rules")).to_contain_text("faster than 2 m/s")
        alerts.get_by_role("button", name="New: parked").click()
        expect(alerts.get_by_label("For at least").filter(visible=True)).to_have_value("60")
        alerts.get_by_role("button", name="Cancel").click()
        alerts.get_by_role("button", name="New: Tags too close").click()
        form = alerts.get_by_role("form", name="Rule", exact=True)
        form.get_by_label("Name").fill("Keep apart")
        form.get_by_label("Closer than").fill("2.5")
        form.get_by_label("Groups").fill("forklifts, hall 3")
        form.get_by_role("button", name="Save rule").click()
        expect(alerts.get_by_role("list", name="Rules")).to_contain_text("Closer than 2.5 m")
        made = place.parts.items.rules.all["keep-apart"]
        assert isinstance(made, TooCloseRule)
        assert (made.distance_m, made.delay_s, made.groups, made.name) == (
            2.5,
            1.0,
            ["forklifts", "hall 3"],
            "Keep apart",
        )
        alerts.get_by_role("button", name="New: Battery low").click()
        expect(form.get_by_label("Closer than")).to_be_hidden()
        form.get_by_label("Name").fill("Charge")
        form.get_by_label("Charge below").fill("0.3")
        expect(form.get_by_label("It makes")).to_have_value("alarm")
        form.get_by_label("It makes").select_option("a warning")
        form.get_by_role("button", name="Save rule").click()
        expect(form).to_be_hidden()
        assert place.parts.items.rules.all["charge"] == BatteryLowRule(
            type="battery_low", id="charge", name="Charge", fraction=0.3, severity=Severity.WARNING
        )
        alerts.get_by_role("button", name="Edit Keep apart").click()
        expect(form.get_by_label("Closer than")).to_have_value("2.5")
        place.parts.items.rules.put("keep-apart", made.model_copy(update={"distance_m": 9.0}))
        form.get_by_label("Closer than").fill("4")
        form.get_by_role("button", name="Save rule").click()
        expect(form.get_by_role("alert")).to_contain_text("Somebody else changed this meanwhile")
        form.get_by_role("button", name="Take the newer one").click()
        expect(form.get_by_label("Closer than")).to_have_value("9")
        form.get_by_role("button", name="Delete…").click()
        page.page.get_by_role("button", name="Delete rule").click()
        expect(form).to_be_hidden()
        assert list(place.parts.items.rules.all) == ["charge"]
        alerts.get_by_role("button", name="Edit Yard 10").click()
        expect(page.page.get_by_role("form", name="Zone", exact=True).get_by_label("Too long after")).to_have_value(
            "300"
        )


def test_what_is_typed_stays_while_the_lists_are_refreshed(chromium: Browser) -> None:
    place = alert_place()
    put_mail(place)
    with served(place), watched_page(chromium, place.url) as page:
        alerts = opened(page)
        alerts.get_by_role("button", name="Edit shift").click()
        addresses = alerts.get_by_label("Addresses")
        addresses.fill("late@example.com")
        happen(place, "cart-3")
        page.wait_for("dropanchor.destinations()[0].pending === 1")
        expect(addresses).to_have_value("late@example.com")


def test_a_reader_sees_destinations_and_rules_but_no_buttons(chromium: Browser, tmp_path: Path) -> None:
    place = alert_place()
    put_mail(place)
    keys = ApiKeys(tmp_path)
    secret = keys.add("reader", Scope.READ)
    with served(place, Authenticator({SOURCE: keys})), open_page(chromium, place.url) as page:
        page.page.locator("#key").fill(secret)
        page.page.locator("#locked button").click()
        page.wait_for("window.dropanchor?.status() === 'live'")
        alerts = opened(page)
        expect(alerts.get_by_role("list", name="Destinations")).to_contain_text("e-mail to shift@example.com")
        expect(alerts.get_by_role("button")).to_have_count(0)
