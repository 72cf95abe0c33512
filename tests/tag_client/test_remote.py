"""A program applies what the service sets, and an IMU that is slowed down keeps the integrals of its samples."""

import pytest

from dropanchor_schemas.kinds import ImuSample
from dropanchor_tag_client.remote import Decimator, RemoteSettings, parse

MS = 1_000_000


def test_settings_are_parsed_and_what_a_newer_service_adds_is_ignored() -> None:
    assert parse(b'{"batch_s": 0.5, "imu_hz": null, "more": 1}') == RemoteSettings(0.5, None)
    assert parse(b"{}") == RemoteSettings()


@pytest.mark.parametrize(
    "payload", [b"", b"[]", b"{", b'{"batch_s": "1"}', b'{"batch_s": 0}', b'{"imu_hz": 1e9}', b'{"imu_hz": NaN}']
)
def test_settings_that_cannot_be_applied_are_left_out(payload: bytes) -> None:
    assert parse(payload) is None


def test_each_period_gives_the_mean_of_its_samples() -> None:
    decimator = Decimator(10.0)
    samples = [ImuSample(i * 10 * MS, (float(i), 0.0, 9.81), (0.0, 0.0, i / 10)) for i in range(101)]
    means = [mean for sample in samples if (mean := decimator.add(sample)) is not None]
    assert len(means) == 10
    assert means[0].t_ns == 45 * MS
    assert means[0].acc == pytest.approx((4.5, 0.0, 9.81))
    assert sum(mean.gyro[2] for mean in means) * 0.1 == pytest.approx(sum(s.gyro[2] for s in samples[:100]) * 0.01)
    assert means[0].mag is None


def test_a_magnetic_field_that_comes_seldom_is_kept() -> None:
    decimator = Decimator(10.0)
    decimator.add(ImuSample(0, (0, 0, 0), (0, 0, 0), (1.0, 2.0, 3.0)))
    decimator.add(ImuSample(50 * MS, (0, 0, 0), (0, 0, 0)))
    mean = decimator.add(ImuSample(100 * MS, (0, 0, 0), (0, 0, 0)))
    assert mean is not None
    assert mean.mag == (1.0, 2.0, 3.0)


def test_an_imu_slower_than_the_wanted_rate_keeps_every_sample() -> None:
    decimator = Decimator(100.0)
    found = [decimator.add(ImuSample(i * 40 * MS, (0, 0, 0), (0, 0, 0))) for i in range(5)]
    assert [mean.t_ns for mean in found if mean is not None] == [0, 40 * MS, 80 * MS, 120 * MS]


def test_what_the_service_sets_is_said_in_words() -> None:
    assert RemoteSettings(0.5, 50.0).in_words == "batches: 0.5 s, IMU samples: at most 50 per second"
    assert RemoteSettings().in_words == "batches: as the program says, IMU samples: as the IMU gives them"
