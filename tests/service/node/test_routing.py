"""Which bucket a request is about."""

import pytest

from dropanchor_service.node.routing import Unknown, bucket_for

POSES = "/api/v1/sites/x/poses"


@pytest.mark.parametrize(
    ("path", "site", "buckets", "expected"),
    [
        (POSES, "017.yard", ["017", "018"], "017"),
        (POSES, "019.yard", ["017", "018"], Unknown.SITE),
        (POSES, "yard", ["017", "old"], "old"),
        (POSES, "yard", ["017", "old", "older"], Unknown.SITE),
        (POSES, "yard", ["017", "018"], Unknown.SITE),
        (POSES, "anything", ["yard"], "yard"),
        ("/api/v1/poses", None, ["yard"], "yard"),
        ("/api/v1/poses", None, ["017", "018"], Unknown.NO_SITE),
        ("/api/v1/openapi.json", None, ["017", "018"], "017"),
        ("/api/v1/sites", None, ["017", "018"], "017"),
        (POSES, "017.yard", [], Unknown.NO_BUCKETS),
    ],
)
def test_a_site_leads_to_its_bucket(path: str, site: str | None, buckets: list[str], expected: object) -> None:
    assert bucket_for(path, site, buckets) == expected
