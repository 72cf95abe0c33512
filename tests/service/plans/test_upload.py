"""A file that is too hard to read is refused, and does no harm."""

import asyncio

import pytest

from dropanchor_service.plans.reading.messages import ReadPlan, Request
from dropanchor_service.plans.reading.refused import RefusedError
from dropanchor_service.plans.upload import TIMEOUT_S, PlanReader
from support.plan_files import image_file

PNG = Request(media_type="image/png")


def read(request: Request, timeout_s: float = TIMEOUT_S) -> ReadPlan:
    return asyncio.run(PlanReader(timeout_s).read(image_file(40, 20), request))


def test_a_file_is_read_by_another_process() -> None:
    found = read(PNG)
    assert (found.description.width_px, found.description.height_px) == (40, 20)
    assert found.content.startswith(b"\x89PNG")


def test_a_refusal_of_the_other_process_arrives_as_it_is() -> None:
    with pytest.raises(RefusedError, match=r"^The PDF is damaged\.$"):
        read(Request(media_type="application/pdf"))


def test_a_file_that_takes_too_long_is_refused_with_what_to_do() -> None:
    with pytest.raises(RefusedError, match="Save it as PNG with fewer pixels"):
        read(PNG, timeout_s=0.05)


def test_a_process_that_breaks_is_a_refusal() -> None:
    with pytest.raises(RefusedError, match="damaged"):
        read(PNG.model_copy(update={"page": 10**4500}))  # more digits than it can read
