"""A tag whose service is away says so ever more rarely, and counts its attempts."""

import logging
from itertools import count
from unittest.mock import patch

import pytest
import zenoh

from dropanchor_tag_client.reminders import Reminders
from dropanchor_tag_client.session import SessionSettings, open_session


def said_within(hours: float) -> list[str]:
    """Return what a tag says that tries every five seconds."""
    now_s = 0.0
    reminders = Reminders(lambda: now_s)
    said = []
    while now_s < hours * 3600:
        if reminders.failed():
            said.append(reminders.words)
        now_s += 5.0
    return said


def test_eighteen_minutes_without_a_service_take_a_few_lines_with_the_attempts() -> None:
    assert said_within(0.3) == [
        "Still trying",
        *(f"Still trying (attempt {number})" for number in (3, 7, 15, 31, 63, 127)),
    ]


def test_a_month_without_a_service_takes_a_line_an_hour() -> None:
    assert 720 <= len(said_within(24 * 30)) <= 730


def test_a_session_that_cannot_be_opened_says_so_once_for_many_attempts(caplog: pytest.LogCaptureFixture) -> None:
    opened, attempts = object(), count(1)

    def connect(_: zenoh.Config) -> object:
        if next(attempts) < 100:
            raise zenoh.ZError("refused")
        return opened

    with (
        patch.object(zenoh, "open", connect),
        patch("dropanchor_tag_client.session.time.sleep"),
        caplog.at_level(logging.WARNING),
    ):
        assert open_session(SessionSettings()) is opened
    assert len(caplog.records) == 1
    assert caplog.messages[0].endswith("Still trying.")
