"""Anchors are placed, moved, added and deleted on the page, and changes of other pages are respected."""

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, expect

from dropanchor_schemas.site import Anchor
from service.dashboard.place import Place
from support.browser import WatchedPage, watched_page
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser


def anchors_of(place: Place) -> dict[str, Anchor]:
    return {anchor.id: anchor for anchor in place.bench.answers.site.site.anchors}


def open_setup(page: WatchedPage) -> Locator:
    """Open the panel of the anchors, and return it once the map shows an anchor and stands still."""
    page.page.get_by_role("button", name="Set up anchors").click()
    page.wait_for("dropanchor.anchors().length > 0 && dropanchor.drawing().still")
    return page.page.get_by_role("region", name="Anchors", exact=True)


def pixel_of(page: WatchedPage, anchor: str) -> tuple[float, float]:
    """Return where an anchor is on the screen."""
    box = page.page.locator("#map").bounding_box()
    assert box is not None
    shown: list[dict[str, Any]] = page.page.evaluate("dropanchor.anchors()")
    (pixel,) = [one["pixel"] for one in shown if one["id"] == anchor]
    return box["x"] + pixel[0], box["y"] + pixel[1]


def select(page: WatchedPage, panel: Locator, anchor: str) -> None:
    """Select an anchor in the list, and wait until the page has read it."""
    with page.page.expect_response(lambda response: f"/anchors/{anchor}" in response.url):
        panel.get_by_role("button", name=f"{anchor}: ").click()


def drag(
    page: WatchedPage, anchor: str, right: float, up: float, before_drop: Callable[[], None] = lambda: None
) -> None:
    """Drag an anchor by so many pixels. before_drop: called while the button is still pressed."""
    x, y = pixel_of(page, anchor)
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x + right / 2, y - up / 2)
    page.page.mouse.move(x + right, y - up)
    before_drop()
    page.page.mouse.up()


def confirm(page: WatchedPage) -> None:
    page.page.get_by_role("form", name="Place the anchor").get_by_role("button", name="Move").click()


@pytest.mark.parametrize(
    ("language", "edit", "form", "question", "move", "cancel"),
    [
        (
            "en-GB",
            "Set up anchors",
            "Place the anchor",
            "Move anchor 17 by 1.2 m: 2 tags are concerned.",
            "Move",
            "Cancel",
        ),
        (
            *("de-DE", "Anker einrichten", "Anker platzieren"),
            *("Anker 17 um 1,2 m verschieben: 2 Tags sind betroffen.", "Verschieben", "Abbrechen"),
        ),
    ],
)
def test_an_anchor_moves_only_when_somebody_has_seen_how_far_and_which_tags_that_concerns(
    chromium: Browser, place: Place, language: str, edit: str, form: str, question: str, move: str, cancel: str
) -> None:
    place.move("cart", "lift", x=1.0, y=1.0)
    with watched_page(chromium, place.url, locale=language) as page:
        page.wait_for("dropanchor.tags().length === 2")
        page.page.get_by_role("button", name=edit).click()
        with page.page.expect_response(lambda response: "/anchors/17" in response.url):
            page.page.get_by_role("button", name="17: ").click()
        place_form = page.page.get_by_role("form", name=form)
        for last in (cancel, move):
            page.page.locator("#map").focus()
            for key in ("Shift+ArrowRight", "ArrowRight", "ArrowRight"):
                page.page.keyboard.press(key)
            expect(place_form.get_by_role("status")).to_have_text(question)
            assert anchors_of(place)["17"] == Anchor(id="17")
            place_form.get_by_role("button", name=last).click()
            if last == cancel:
                page.wait_for("dropanchor.anchors()[0].x === 0")
                with page.page.expect_response(lambda response: "/anchors/17" in response.url):
                    page.page.get_by_role("button", name="17: ").click()
        wait_until(lambda: anchors_of(place)["17"] == Anchor(id="17", x=1.2))
        expect(place_form.get_by_role("status")).to_have_text("")
        assert page.errors == []


def test_an_anchor_moved_by_a_drag_or_by_keys_moves_in_every_open_page_and_undo_moves_it_back(
    chromium: Browser, place: Place
) -> None:
    with watched_page(chromium, place.url) as page, watched_page(chromium, place.url) as other:
        panel = open_setup(page)
        drag(page, "17", 60, 30)
        assert anchors_of(place)["17"] == Anchor(id="17")
        confirm(page)
        outcome = page.page.locator("#outcome")
        expect(outcome).to_contain_text("Anchor 17 moved.")
        moved = anchors_of(place)["17"]
        assert moved.y > 0.1
        assert moved.x == pytest.approx(2 * moved.y, abs=0.05)
        other.wait_for(f"dropanchor.anchors()[0]?.x === {moved.x}")
        outcome.get_by_role("button", name="Undo").click()
        expect(outcome).to_contain_text("Undone: Anchor 17 moved.")
        assert anchors_of(place)["17"] == Anchor(id="17")
        for one in (page, other):
            one.wait_for("dropanchor.anchors()[0].x === 0")
        page.page.locator("#map").focus()
        for key in ("ArrowRight", "ArrowRight", "Shift+ArrowUp"):
            page.page.keyboard.press(key)
        expect(panel.get_by_label("y", exact=False).nth(0)).to_have_value("1")
        page.page.keyboard.press("Enter")
        wait_until(lambda: anchors_of(place)["17"] == Anchor(id="17", x=0.2, y=1.0))
        assert page.errors == other.errors == []


def test_a_drag_over_a_change_of_another_page_asks_whose_is_kept(chromium: Browser, place: Place) -> None:
    newer = Anchor(id="17", x=3.0, y=1.0)
    with watched_page(chromium, place.url) as page:
        select(page, open_setup(page), "17")
        outcome = page.page.locator("#outcome")
        drag(page, "17", 60, 0, lambda: place.bench.answers.site.set_anchor(newer))
        confirm(page)
        expect(outcome).to_contain_text("Somebody else changed this meanwhile")
        assert anchors_of(place)["17"] == newer
        with page.page.expect_response(lambda response: "/anchors/17" in response.url):
            outcome.get_by_role("button", name="Take the newer one").click()
        page.wait_for("dropanchor.anchors()[0].x === 3 && dropanchor.drawing().still")
        newest = Anchor(id="17", x=3.5, y=1.0)
        drag(page, "17", -40, 0, lambda: place.bench.answers.site.set_anchor(newest))
        confirm(page)
        outcome.get_by_role("button", name="Keep mine").click()
        wait_until(lambda: anchors_of(place)["17"].x < 3.0)
        page.wait_for("dropanchor.anchors()[0].x < 3 && dropanchor.drawing().still")
        expect(outcome).not_to_contain_text("Somebody else")
        expect(page.page.get_by_role("form", name="Place the anchor").get_by_role("status")).to_have_text(
            ""
        )  # read again
        drag(page, "17", 0, 60)
        confirm(page)
        wait_until(lambda: anchors_of(place)["17"].y > 1.2)
        assert all("412" in error for error in page.errors)


def test_an_anchor_with_an_id_of_its_own_is_added_where_the_map_is_clicked_and_deleted_after_a_question(
    chromium: Browser, place: Place
) -> None:
    with watched_page(chromium, place.url) as page:
        panel = open_setup(page)
        panel.get_by_role("button", name="Add anchor").click()
        form = page.page.get_by_role("form", name="Place the anchor")
        form.get_by_label("Id").fill("17")
        form.get_by_role("button", name="Add", exact=True).click()
        expect(page.page.locator("#outcome")).to_contain_text("changed this meanwhile")
        assert anchors_of(place) == {"17": Anchor(id="17")}
        form.get_by_label("Id").fill("gate/2")
        x, y = pixel_of(page, "17")
        page.page.mouse.click(x + 100, y - 50)
        form.get_by_label("Height").fill("2.5")
        form.get_by_role("button", name="Add", exact=True).click()
        expect(page.page.locator("#outcome")).to_contain_text("Anchor gate/2 added.")
        added = anchors_of(place)["gate/2"]
        assert [added.x, added.z] == pytest.approx([2 * added.y, 2.5], abs=0.05)
        form.get_by_role("button", name="Delete…").click()
        dialog = page.page.get_by_role("dialog")
        dialog.get_by_role("button", name="Cancel").click()
        assert "gate/2" in anchors_of(place)
        form.get_by_role("button", name="Delete…").click()
        dialog.get_by_role("button", name="Delete").click()
        expect(page.page.locator("#outcome")).to_contain_text("Anchor gate/2 deleted.")
        assert list(anchors_of(place)) == ["17"]
        page.page.keyboard.press("Control+z")
        wait_until(lambda: anchors_of(place).get("gate/2") == added)
        assert all("412" in error for error in page.errors)
