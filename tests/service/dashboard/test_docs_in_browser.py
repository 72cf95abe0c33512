"""The interactive documentation in a real browser, without any other server."""

import pytest
from playwright.sync_api import Browser, expect

from service.dashboard.place import Place
from support.browser import open_page

pytestmark = pytest.mark.browser


def test_an_operation_can_be_tried_without_another_server(chromium: Browser, place: Place) -> None:
    place.move("cart", x=1.0, y=2.0)
    with open_page(chromium, f"{place.url}docs", size=(1280, 800)) as page:
        operation = page.page.locator("#operations-poses-get_pose")
        expect(operation).to_be_in_viewport()
        operation.locator(".opblock-summary-control").click()
        operation.get_by_role("button", name="Try it out").click()
        operation.get_by_placeholder("tag").fill("cart")
        operation.get_by_role("button", name="Execute").click()
        expect(operation.locator(".live-responses-table tbody .response-col_status")).to_contain_text("200")
        expect(operation.locator(".live-responses-table")).to_contain_text('"tag": "cart"')
        expect(page.page.get_by_role("button", name="Authorize")).to_be_visible()
        assert page.origins == {place.url.rstrip("/")}
        assert page.errors == []
