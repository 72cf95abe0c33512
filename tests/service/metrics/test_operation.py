"""Prometheus sees whether the service is ready, how full the disk is, and which certificates end."""

import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path

from prometheus_client import CollectorRegistry

from dropanchor_service.metrics.operation import OperationGauges
from dropanchor_service.security.certificate import Certificate
from dropanchor_service.security.credentials import expiries_of
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.issued import Table
from support.certificate import self_signed

DAY_S = 86_400


def test_the_service_is_ready_until_it_has_a_problem() -> None:
    registry, problems = CollectorRegistry(), list[str]()
    registry.register(OperationGauges(lambda: problems, lambda: ["the disk is full"], None, dict))
    assert registry.get_sample_value("dropanchor_ready") == 1
    assert registry.get_sample_value("dropanchor_impairments") == 1
    problems.append("no router")
    assert registry.get_sample_value("dropanchor_ready") == 0
    assert registry.get_sample_value("dropanchor_disk_bytes") is None


def test_the_disk_is_that_of_the_data_folder(tmp_path: Path) -> None:
    registry = CollectorRegistry()
    registry.register(OperationGauges(list, list, tmp_path, dict))
    free = registry.get_sample_value("dropanchor_disk_free_bytes")
    assert registry.get_sample_value("dropanchor_disk_bytes") == shutil.disk_usage(tmp_path).total
    assert free is not None
    assert 0 < free <= shutil.disk_usage(tmp_path).total


def test_the_end_of_a_certificate_is_known_and_moves_when_it_is_renewed(tmp_path: Path) -> None:
    folder = SecurityFolder.make(
        tmp_path / "security", Table(site="yard", hosts=("127.0.0.1",), listen=("tls/0.0.0.0:7447",)), days=10
    )
    folder.add_tag("a", days=5)
    folder.add_tag("b", days=3)
    own = Certificate(*self_signed(tmp_path))
    registry = CollectorRegistry()
    registry.register(OperationGauges(list, list, None, lambda: expiries_of(own, folder)))

    def days_left(name: str) -> int:
        end = registry.get_sample_value("dropanchor_certificate_end_seconds", {"certificate": name})
        assert end is not None
        return round((end - datetime.now(UTC).timestamp()) / DAY_S)

    assert (days_left("service"), days_left("tags"), days_left("http")) == (10, 3, 1)
    SecurityFolder.open(folder.path).renew([], days=30)
    assert days_left("service") == 30
    own.certificate.unlink()
    assert registry.get_sample_value("dropanchor_certificate_end_seconds", {"certificate": "http"}) is None
    assert folder.expiring(timedelta(days=4)) != []
