"""Find tags and act on them: the filter's keys, several tags at once, and the menu of what can be done at a place."""

import math
import time
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Position, Route, expect

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.history.storage import Retention
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from service.dashboard.place import Place, live_api_bench
from service.dashboard.zone_place import served, zone_place
from support.axe import violations
from support.browser import WatchedPage, open_page, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser

SECOND = 1_000_000_000
RETENTION = Retention(SECOND, 0.1, 5 * SECOND, 10**18, 2**40)
PLACES = {"cart-1": (0.0, 4.0), "cart-2": (6.0, 4.0), "cart-12": (6.0, -4.0), "van": (0.0, -4.0)}
EVERYWHERE = ["Measure from here", "Copy 0.00, -4.00 m"]


def put_tags(place: Place, **fields: object) -> None:
    """Put the tags where PLACES says, with poses that stay fresh."""
    x, y = zip(*PLACES.values(), strict=True)
    fresh_ns = time.time_ns() + 600 * SECOND
    fields = {"t_ns": fresh_ns, "speed": 0.5, "range": 5.0, "heading": math.nan} | fields
    place.bench.move(*PLACES, x=list(x), y=list(y), **fields)


def selected(page: WatchedPage) -> list[str]:
    rows = page.page.locator("tr[aria-selected='true']:visible")
    return sorted(str(row.get_attribute("data-tag")) for row in rows.all())


def at(page: WatchedPage, tag: str) -> Position:
    x, y = page.tags()[tag]["pixel"]
    return Position(x=x, y=y)


def beside(page: WatchedPage, x: float, y: float) -> Position:
    """Return where a place of the site is on the map."""
    px, py = page.page.evaluate(f"dropanchor.screen({x}, {y})")
    return Position(x=px, y=py)


def test_enter_selects_the_only_hit_and_arrows_choose_among_several(chromium: Browser, place: Place) -> None:
    put_tags(place)
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(4)
        name, keys = page.page.locator("#detail [data-part='name']"), page.page.keyboard
        keys.press("/")
        keys.type("van")
        keys.press("Enter")
        expect(name).to_have_text("van")
        keys.press("Escape")
        expect(page.page.locator("#filter")).to_have_value("")
        expect(page.page.locator("#count")).to_have_text("4 tags")
        expect(name).to_have_text("van")
        keys.press("Escape")
        expect(name).to_be_hidden()
        keys.type("cart-1")  # the field still has the focus; one of two tags is called exactly so
        keys.press("Enter")
        expect(name).to_have_text("cart-1")
        page.page.locator("#filter").fill("cart")
        keys.press("Enter")
        expect(page.page.locator("#said")).to_have_text("3 tags are called so. Choose one with the arrow keys.")
        for _ in range(2):
            keys.press("ArrowDown")
        row = str(page.page.locator("#filter").get_attribute("aria-activedescendant"))
        reached = page.page.locator(f"#{row}").get_attribute("data-tag")
        keys.press("Enter")
        expect(name).to_have_text(str(reached))
        page.page.locator("#filter").fill("nobody")
        keys.press("Enter")
        expect(page.page.locator("#said")).to_have_text("No tag is called so.")
        assert page.errors == []


def check_colours(page: WatchedPage) -> None:
    """Each of the selected tags has a colour of its own: in the list, in the comparison and around its dot."""
    page.wait_for("dropanchor.drawing().still")
    known, seen = page.tags(), []
    places = [known[tag]["pixel"] for tag in ("cart-1", "van")]
    pixels = page.pixels([(x + dx, y + dy) for x, y in places for dx, dy in ((-11.5, 0), (0, 11.5), (0, -11.5))])
    for number, tag in enumerate(("cart-1", "van")):
        cells = [f"tr[data-tag='{tag}'] .c-tag", f"#comparison th:text-is('{tag}')"]
        marks = [page.page.locator(one).evaluate("one => one.style.getPropertyValue('--mark')") for one in cells]
        ring = tuple(int(marks[0][at : at + 2], 16) for at in (1, 3, 5))
        around = pixels[3 * number : 3 * number + 3]
        assert any(pixel[:3] == pytest.approx(ring, abs=40) for pixel in around), (ring, around)
        seen.append(marks)
    assert seen[0][0] == seen[0][1] != seen[1][0] == seen[1][1]


def test_several_tags_are_selected_by_mouse_keys_and_rectangle_compared_and_followed(
    chromium: Browser, place: Place, axe: str
) -> None:
    put_tags(place)
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(4)
        title, map_ = page.page.locator("#several h2"), page.page.locator("#map")
        page.page.locator("tr[data-tag='cart-1']").click()
        page.page.locator("tr[data-tag='van']").click(modifiers=["Control"])
        expect(title).to_have_text("2 tags selected")
        expect(page.page.locator("#detail")).to_be_hidden()
        assert selected(page) == ["cart-1", "van"]
        check_colours(page)
        map_.click(position=at(page, "cart-12"), modifiers=["Control"])
        expect(title).to_have_text("3 tags selected")
        map_.click(position=at(page, "cart-12"), modifiers=["Control"])
        map_.click(position=at(page, "van"), modifiers=["Control"])
        expect(page.page.locator("#detail [data-part='name']")).to_have_text("cart-1")  # one tag is no group of tags
        page.page.locator("tr[data-tag='cart-1']").click()
        page.page.locator("tr[data-tag='cart-12']").click(modifiers=["Shift"])
        assert selected(page) == ["cart-1", "cart-12", "cart-2"]
        page.page.keyboard.press("Escape")
        assert selected(page) == []

        held: list[Route] = []
        page.page.route("**/explain*", lambda route: held.append(route))
        page.page.locator("#table").focus()
        for key in ("Home", "ArrowDown", "Control+ ", "ArrowDown"):
            page.page.keyboard.press(key)
        while not held:
            page.page.wait_for_timeout(20)
        with page.page.expect_response("**/explain*"):  # it comes late, and does not take the keys back to its tag
            held[0].continue_()
        page.page.unroute("**/explain*")
        page.page.keyboard.press("Shift+ArrowDown")
        assert selected(page) == ["cart-12", "cart-2", "van"]
        page.page.keyboard.press("Control+a")
        expect(title).to_have_text("4 tags selected")
        page.page.get_by_role("button", name="Clear", exact=True).click()
        expect(title).to_be_hidden()

        page.wait_for("dropanchor.drawing().still")
        corner, opposite = beside(page, 5.0, 4.6), beside(page, 6.6, -4.6)
        box = map_.bounding_box() or {"x": 0, "y": 0}
        page.page.keyboard.down("Shift")
        page.page.mouse.move(box["x"] + corner["x"], box["y"] + corner["y"])
        page.page.mouse.down()
        page.page.mouse.move(box["x"] + opposite["x"], box["y"] + opposite["y"], steps=3)
        page.page.mouse.up()
        page.page.keyboard.up("Shift")
        assert selected(page) == ["cart-12", "cart-2"]
        lines = page.page.locator("#comparison tr").all_inner_texts()
        assert lines[0].split("\t") == ["Tag", "State", "Position", "Accuracy (95 %)", "Speed", "Last range", "Hint"]
        assert lines[1].split("\t")[:6] == ["cart-2", "Tracking", "6.00, 4.00 m", "± 0.49 m", "0.50 m/s", "5.00 m"]

        page.page.locator("#several").get_by_role("button", name="Follow").click()
        page.wait_for("location.hash.includes('follow') && location.hash.includes('tags=cart-2,cart-12')")
        place.move("cart-2", x=80.0, y=40.0, t_ns=time.time_ns() + 700 * SECOND)
        page.wait_for(
            "dropanchor.drawing().still && dropanchor.tags().filter(({tag, x, pixel: [px, py]}) => "
            "['cart-2', 'cart-12'].includes(tag) && (tag !== 'cart-2' || x > 70) && px > 0 && py > 0"
            " && px < document.getElementById('map').clientWidth"
            " && py < document.getElementById('map').clientHeight).length === 2"
        )
        page.page.reload()
        expect(title).to_have_text("2 tags selected")
        expect(page.page.locator("tr[aria-selected='true']:visible")).to_have_count(2)
        assert selected(page) == ["cart-12", "cart-2"]
        assert violations(page.page, axe) == []
        assert page.errors == []


def test_selected_tags_are_put_into_a_group_and_their_tracks_saved_in_one_file(
    chromium: Browser, tmp_path: Path
) -> None:
    site = Site(id="yard", anchors=[Anchor(id="1", x=0, y=0)], georeference=Georeference(lat=52.0, lon=13.0))
    bench = live_api_bench(site, folder=tmp_path, retention=RETENTION)
    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        for second in range(60):
            put_tags(place, t_ns=time.time_ns() - (90 - second) * SECOND)
        bench.write_history()
        with watched_page(chromium, f"{place.url}#tags=cart-1,van,nobody", size=(1024, 768)) as page:
            expect(page.page.locator("#several h2")).to_have_text("3 tags selected")
            several = page.page.locator("#several")
            for kind, needle in (("CSV", "\r\nvan,"), ("GeoJSON", '"properties":{"tag":"van"')):
                page.page.locator("tr[data-tag='van']").click()
                page.page.locator("tr[data-tag='cart-1']").click(modifiers=["Control"])
                with page.page.expect_download() as download:
                    several.get_by_role("button", name=kind, exact=True).click()
                text = download.value.path().read_bytes().decode()
                assert text.count(needle) >= 10
                assert text.count(needle.replace("van", "cart-1")) >= 10
            several.get_by_label("Group", exact=True).fill("forklifts")
            several.get_by_role("button", name="Put into group").click()
            expect(page.page.locator("#outcome")).to_contain_text("cart-1 is in the group forklifts now.")
            expect(page.page.locator("#group option", has_text="forklifts")).to_have_count(1)
            groups = {tag: bench.answers.site.tag_settings(tag).group for tag in PLACES}
            assert groups == {"cart-1": "forklifts", "van": "forklifts", "cart-2": "", "cart-12": ""}
            page.wait_for("location.hash.includes('tags=van,cart-1')")
            assert page.errors == []


def test_a_right_click_and_a_key_offer_what_can_be_done_at_a_place_and_with_a_tag(chromium: Browser, axe: str) -> None:
    place = zone_place()
    with served(place):
        put_tags(place)
        with watched_page(chromium, f"{place.url}?lang=de") as page:
            page.wait_for_map(4)
            map_, menu = page.page.locator("#map"), page.page.locator("#menu")

            def ask(x: float, y: float, item: str) -> None:
                map_.click(position=beside(page, x, y), button="right")
                menu.get_by_role("menuitem", name=item).click()
                expect(menu).to_be_hidden()

            ask(3.0, 1.0, "Ab hier messen")
            map_.click(position=beside(page, 3.0, -3.0))
            expect(page.page.locator("#measured")).to_contain_text("180° S")
            page.page.keyboard.press("Escape")

            map_.click(position=at(page, "van"), button="right")
            assert menu.get_by_role("menuitem").all_inner_texts()[:3] == [
                "Einzelheiten",
                "Folgen",
                "Zur Auswahl hinzunehmen",
            ]
            assert violations(page.page, axe) == []
            map_.click(position=at(page, "van"), button="right")
            menu.get_by_role("menuitem", name="Zur Auswahl hinzunehmen").click()
            map_.click(position=at(page, "cart-1"))
            assert selected(page) == ["cart-1", "van"]
            page.page.keyboard.press("Escape")

            map_.click(position=beside(page, 3.0, 2.0), button="right")
            menu.get_by_role("menuitem", name="Ein Tag ist hier …").click()
            menu.get_by_role("menuitem", name="cart-12").click()
            page.page.keyboard.press("Enter")  # the button that sets the start has the focus
            expect(page.page.locator("#outcome")).to_contain_text("cart-12")
            start = place.bench.answers.site.tag_settings("cart-12").start
            assert start is not None
            assert (start.x, start.y) == pytest.approx((3.0, 2.0), abs=0.1)

            ask(3.0, 0.0, "Runde Zone hier")
            form = page.page.locator("#zone-form")
            form.get_by_label("Name").fill("Tor")
            form.locator("button").first.click()
            expect(form).to_be_hidden()
            assert place.zones["tor"].shape.model_dump()["x"] == pytest.approx(3.0, abs=0.1)
            ask(3.0, 3.0, "Anker hier …")
            assert float(page.page.locator("#setup [name='y']").input_value()) == pytest.approx(3.0, abs=0.1)
            page.page.locator("#setup [data-part='close']").click()

            page.page.locator("#table").focus()
            page.page.keyboard.press("Home")
            page.page.keyboard.press("Shift+F10")
            expect(menu.locator("p")).to_have_text("cart-1")
            page.page.keyboard.press("End")
            assert page.page.evaluate("document.activeElement.textContent") == "0.00, 4.00 m kopieren"
            page.page.keyboard.press("Enter")
            expect(page.page.locator("#said")).to_have_text("Kopiert: 0.00, 4.00")
            assert page.page.evaluate("document.activeElement.id") == "table"
            assert page.errors == []


def test_a_long_press_offers_the_same_and_a_key_that_only_reads_no_change(chromium: Browser, tmp_path: Path) -> None:
    keys, bench = ApiKeys(tmp_path), live_api_bench()
    secret = keys.add("person", Scope.READ)
    app = bench.app(DASHBOARD, authenticator=Authenticator({SOURCE: keys}))
    with running_server(app, bench.stopping) as port:
        put_tags(place := Place(bench, f"http://127.0.0.1:{port}/"))
        with open_page(chromium, place.url, size=(390, 844)) as page:
            page.page.locator("#key").fill(secret)
            page.page.keyboard.press("Enter")
            page.wait_for("window.dropanchor?.status() === 'live'")
            page.wait_for_map(4)
            touch = page.page.context.new_cdp_session(page.page)
            touch.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
            box = page.page.locator("#map").bounding_box() or {"x": 0, "y": 0}
            menu = page.page.locator("#menu")
            for place_on_map, offered in (
                (beside(page, 3.0, 0.0), ["Measure from here", "Copy 3.00, 0.00 m"]),
                (at(page, "van"), ["Details", "Follow", "Add to the selection", "Where it was", *EVERYWHERE]),
            ):
                point = {"x": box["x"] + place_on_map["x"], "y": box["y"] + place_on_map["y"]}
                touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [point]})
                menu.wait_for(state="visible")
                touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
                texts = menu.get_by_role("menuitem").all_inner_texts()
                assert [text.split(", ")[0] for text in texts] == [text.split(", ")[0] for text in offered]
                assert selected(page) == []  # a long press is no tap
            menu.get_by_role("menuitem", name="Add to the selection").click()
            page.page.locator("tr[data-tag='cart-1']").click()
            expect(page.page.locator("#several h2")).to_have_text("2 tags selected")
            page.page.locator("#several summary").click()
            expect(page.page.get_by_role("button", name="GeoJSON").last).to_be_visible()
            expect(page.page.get_by_role("button", name="Put into group")).to_be_hidden()
            assert [error for error in page.errors if "401" not in error] == []
