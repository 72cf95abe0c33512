"""The page in a real browser with the real REST API, over a store that the tests fill."""

import sysconfig
import time
from contextlib import ExitStack
from threading import Event

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, State, StateReason
from service.dashboard.place import Place, live_api_bench
from support.browser import WatchedPage, watched_page
from support.http_server import running_server
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser

TRACKING_BLUE = (0, 103, 184)


def colour_at(page: WatchedPage, tag: str) -> tuple[int, ...]:
    x, y = page.tags()[tag]["pixel"]
    return page.pixel(x, y)[:3]


def ambiguous(place: Place, tag: str, *modes: tuple[float, float, float]) -> None:
    """Give a tag an ambiguous pose. modes: weight, x and y of each hypothesis."""
    row = place.bench.answers.tags.register(tag).row
    pose, hypotheses = np.zeros(1, POSE), np.zeros(len(modes), HYPOTHESIS)
    pose["row"] = hypotheses["row"] = row
    pose["t_ns"], pose["state"], pose["reason"] = time.time_ns(), State.AMBIGUOUS, StateReason.SEVERAL_MODES
    pose["range"], pose["x"], pose["y"], pose["p_mode"] = 5.0, modes[0][1], modes[0][2], modes[0][0]
    for name, column in zip(("weight", "x", "y"), zip(*modes, strict=True), strict=True):
        hypotheses[name] = column
    hypotheses["cov"] = np.eye(2) * 0.1
    place.bench.answers.latest.write(pose, hypotheses)


def test_the_page_shows_how_to_start_a_tag_and_then_follows_it_on_the_map_and_in_the_table(
    chromium: Browser, place: Place
) -> None:
    with watched_page(chromium, place.url) as page:
        page.page.locator("#empty").wait_for(state="visible")
        page.wait_for("document.querySelector('#command').textContent.includes('--connect')")
        command = page.page.locator("#command").text_content() or ""
        assert command.startswith(f"{sysconfig.get_path('scripts')}/dropanchor-tag simulate")
        assert "--connect tcp/127.0.0.1:19747" in command
        assert not page.page.locator("#credentials").is_visible()
        expect(page.page.get_by_role("button", name="Simulate six tags")).to_be_visible()
        steps = page.page.locator("#empty li")
        expect(steps.get_by_role("img", name="done")).to_have_count(1)
        expect(steps.nth(0)).to_contain_text("✓An anchor")
        expect(steps.nth(2)).to_contain_text("The service listens on this machine alone")
        steps.nth(3).get_by_role("button", name="Choose who is told").click()
        expect(page.page.locator("#alerts")).to_have_attribute("open", "")
        place.move("cart", x=1.0, y=2.0, speed=0.5)
        page.page.locator("#empty").wait_for(state="hidden")
        line = page.page.locator("tr[data-tag='cart']")
        assert line.inner_text().split()[:4] == ["cart", "Tracking", "1.00", "2.00"]
        page.wait_for_map(1)
        before = page.tags()["cart"]["pixel"]
        place.move("cart", x=1.5, y=2.0)
        page.wait_for(f"dropanchor.tags()[0].x === 1.5 && dropanchor.tags()[0].pixel[0] > {before[0]} + 10")
        page.page.locator("tr[data-tag='cart'] td.c-x", has_text="1.50").wait_for()
        page.wait_for_map(1)
        x, y = page.tags()["cart"]["pixel"]
        page.page.locator("#map").click(position={"x": x, "y": y})
        expect(page.page.locator("#detail [data-part='name']")).to_have_text("cart")
        page.page.locator("#map").click(position={"x": 40, "y": 300})
        expect(page.page.locator("#detail")).to_be_hidden()
        assert page.errors == []


def test_only_a_fresh_tracked_pose_is_a_full_dot(chromium: Browser, place: Place) -> None:
    def show(**time: int) -> None:
        for i, state in enumerate(State):
            place.move(state.name, x=float(i), y=1.0, state=state, heading=np.nan, cov=np.eye(3) * 1e-6, **time)

    with watched_page(chromium, place.url) as page:
        show()
        page.wait_for_map(6)
        assert {state.name for state in State if colour_at(page, state.name) == TRACKING_BLUE} == {"TRACKING"}
        show(t_ns=time.time_ns())
        page.page.locator("tr[data-tag='TRACKING'][data-stale='1']").wait_for()
        page.wait_for(
            "dropanchor.tags().find(({ tag }) => tag === 'TRACKING').state === 'coasting' && dropanchor.drawing().still"
        )
        assert colour_at(page, "TRACKING") != TRACKING_BLUE


def test_what_is_known_of_a_tag_is_shown_where_it_is_selected(chromium: Browser, place: Place) -> None:
    """Each tag is one of its own kind."""
    markup = "<img src=x onerror=alert(1)>"
    ambiguous(place, "cart", (0.6, 3.0, 4.0), (0.4, 3.0, -4.0))
    place.bench.answers.tags.register("new")
    place.move("a-1", "a-2", "a-10", x=[1.0, 2.0, 3.0], y=0.5, cov=np.diag([0.04, 0.01, 0.001]))
    place.move("back", x=-12.34, y=-56.78, speed=-10.31, sigma_pos=0.25)
    place.move(markup, x=1.0, y=1.0)
    with watched_page(chromium, place.url) as page:
        name = page.page.locator("#detail [data-part='name']")
        page.page.locator("tr[data-tag='cart']").click()
        page.page.locator("#detail li").first.wait_for()
        texts = page.page.locator("#detail li").all_inner_texts()
        assert [text.split() for text in texts] == [["3.0,", "4.0", "m", "60", "%"], ["3.0,", "−4.0", "m", "40", "%"]]
        page.page.locator("[data-part='hint']", has_text="Walk a few metres").wait_for()
        page.wait_for_map(6)
        assert colour_at(page, "cart") != TRACKING_BLUE

        line = page.page.locator("tr[data-tag='new']")
        assert line.inner_text().split()[:4] == ["new", "Initialising", "–", "–"]
        line.click()
        expect(name).to_have_text("new")

        cell = page.page.locator("tbody td.c-tag", has_text="<img")
        assert cell.get_attribute("title") == markup
        cell.click()
        expect(name).to_have_text(markup)
        page.wait_for("document.querySelector('[data-part=\"v-turn\"]').textContent !== '–'")

        assert page.page.locator("tr[data-tag='back'] td.c-speed").inner_text() == "−10.31"
        for column in ("x", "y", "accuracy", "speed", "age"):
            cell = page.page.locator(f"tr[data-tag='back'] td.c-{column}")
            assert cell.evaluate("cell => cell.scrollWidth <= cell.clientWidth"), column

        page.page.keyboard.press("Escape")
        expect(page.page.locator("#detail")).to_be_hidden()
        page.page.locator("#table").focus()
        for key in ("ArrowDown", "ArrowDown", "ArrowDown", "Enter"):
            page.page.keyboard.press(key)
        expect(name).to_have_text("a-10")
        expect(page.page.locator("tr[aria-selected='true']")).to_have_attribute("data-tag", "a-10")
        expect(page.page.locator("#spoken")).to_contain_text("a-10 selected")
        page.page.keyboard.press("Escape")
        expect(page.page.locator("#detail")).to_be_hidden()
        assert page.errors == []


def test_the_map_moves_by_mouse_and_keys_and_returns_with_show_all(chromium: Browser, place: Place) -> None:
    place.move("cart", x=2.0, y=1.0)
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(1)
        page.page.locator("#fit").click()  # the map may have fitted the anchor alone, if that arrived first
        page.wait_for_map(1)
        fitted = page.tags()["cart"]["pixel"]
        page.page.locator("#map").focus()
        page.page.keyboard.press("ArrowLeft")
        page.wait_for(f"Math.abs(dropanchor.tags()[0].pixel[0] - {fitted[0]} - 60) < 0.01")
        page.page.mouse.move(200, 400)
        page.page.mouse.down()
        page.page.mouse.move(250, 430, steps=4)
        page.page.mouse.up()
        page.wait_for(f"Math.abs(dropanchor.tags()[0].pixel[0] - {fitted[0]} - 110) < 0.01")
        assert page.tags()["cart"]["pixel"] == pytest.approx([fitted[0] + 110, fitted[1] + 30])
        panned = page.tags()["cart"]["pixel"][0]
        page.page.mouse.wheel(0, -400)
        page.wait_for(f"Math.abs(dropanchor.tags()[0].pixel[0] - {panned}) > 10")

        def fits() -> bool:
            page.page.locator("#fit").click()
            return bool(page.page.evaluate(f"Math.abs(dropanchor.tags()[0].pixel[0] - {fitted[0]}) < 1"))

        wait_until(fits)  # repeated, since a late wheel event may zoom again
        added = """() => fetch("api/v1/anchors/42", {
            method: "PUT", headers: {"content-type": "application/json"}, body: '{"id": "42", "x": 80, "y": 0}',
        }).then((answer) => answer.status)"""
        assert page.page.evaluate(added) in (200, 201)
        page.wait_for(f"dropanchor.tags()[0].pixel[0] < {fitted[0]} - 100")  # the new anchor fits, too


def test_names_and_states_filter_table_and_map(chromium: Browser, place: Place) -> None:
    place.move(
        "fork-1", "cart-1", "cart-2", x=[1.0, 2.0, 3.0], y=1.0, state=[State.TRACKING, State.LOST, State.TRACKING]
    )
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(3)
        page.page.keyboard.press("/")
        page.page.keyboard.type("CART")
        page.wait_for_map(2)
        page.page.locator(".chip[data-state='lost']").click()
        page.wait_for_map(1)
        page.page.locator("#count", has_text="1 of 3 tags").wait_for()
        page.page.locator("tr[data-tag='cart-1']").wait_for()
        page.page.locator("#show-all").click()
        page.wait_for_map(3)


def test_dark_follows_the_system_until_the_user_chooses(chromium: Browser, place: Place) -> None:
    with watched_page(chromium, place.url, scheme="dark") as page:
        ground = "getComputedStyle(document.body).backgroundColor"
        assert page.page.evaluate(ground) == "rgb(13, 18, 23)"
        page.page.locator("#theme").click()
        assert page.page.evaluate(ground) == "rgb(244, 246, 248)"
        page.page.reload()
        page.wait_for("window.dropanchor?.status() === 'live'")
        assert page.page.evaluate(ground) == "rgb(244, 246, 248)"


def test_the_page_reconnects_by_itself_after_a_restart_of_the_service(chromium: Browser) -> None:
    bench = live_api_bench()
    with ExitStack() as open_pages:
        with running_server(bench.app(DASHBOARD), bench.stopping) as port:
            place = Place(bench, f"http://127.0.0.1:{port}/")
            place.move("old", x=1.0, y=1.0)
            page = open_pages.enter_context(watched_page(chromium, place.url))
            page.wait_for("dropanchor.tags().length === 1")
        page.page.locator("#lost").wait_for(state="visible")
        bench.stopping = Event()
        with running_server(bench.app(DASHBOARD), bench.stopping, port):
            page.wait_for("dropanchor.status() === 'live'")
            page.page.locator("#lost").wait_for(state="hidden")
            place.move("new", x=2.0, y=2.0)
            page.wait_for("dropanchor.tags().length === 2")


def test_ten_thousand_tags_are_drawn_as_density_with_few_table_rows(chromium: Browser, place: Place) -> None:
    count = 10_000
    random = np.random.default_rng(1)
    with watched_page(chromium, place.url) as page:
        place.move(*(f"tag-{i}" for i in range(count)), x=random.normal(0, 20, count), y=random.normal(0, 20, count))
        page.wait_for("dropanchor.drawing().visible > 5000 && dropanchor.drawing().density")
        page.page.locator("#crowd").wait_for()
        assert page.page.locator("tbody tr").count() < 60
        assert page.errors == []
