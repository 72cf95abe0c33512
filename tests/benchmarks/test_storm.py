"""Measure how long the events of ten thousand tags take that enter a zone at once."""

from pathlib import Path

import pytest

from benchmarks import report
from service.delivery.test_storm import TAGS, check_storm

pytestmark = pytest.mark.benchmark


def test_the_delivery_of_a_storm(tmp_path: Path) -> None:
    report.record(
        "delivery", f"{TAGS:,} tags enter a zone at once: {check_storm(TAGS, tmp_path)} (of the receivers, too)."
    )
