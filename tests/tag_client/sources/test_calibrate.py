"""The calibration finds the errors of simulated sensors, and the client removes them."""

import json
from pathlib import Path

import numpy as np
import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, ImuSample, Vector, decode_packed, encode_packed
from dropanchor_tag_client.calibration import (
    FILE_NAME,
    Calibration,
    CalibrationError,
    read_calibration,
    write_calibration,
)
from dropanchor_tag_client.cli import main
from dropanchor_tag_client.sources.calibration_fit import NotEnoughError, fit
from dropanchor_tag_client.sources.guidance import Guide
from support.chips import FakeLibraries
from support.commands import python, start_python
from support.ingest import IngestBench
from support.magnetism import FIELD_UT, Errors, rotation, samples
from support.patience import PATIENCE_S
from support.zenoh_router import connected_session, make_known, wait_until

FOUND = Calibration((0.1, 0.2, 0.3), 2.0, True, (1.0, 2.0, 3.0), ((1.0, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 2.0)))


def line(sample: ImuSample) -> str:
    return json.dumps({"t_ns": sample.t_ns, "acc": sample.acc, "gyro": sample.gyro, "mag": sample.mag})


def heading_errors_deg(found: Calibration, errors: Errors) -> list[float]:
    """Return how far north is off in the corrected readings of a level tag, all around."""
    exact = samples(
        Errors(errors.gyro_bias, errors.acc_scale, errors.hard_iron, errors.soft_iron, 0.0), 0, tilt_rad=0.0
    )
    off = []
    for i, sample in enumerate(exact[500::50]):
        x, y, _ = found.applied(sample).mag or (0.0, 0.0, 0.0)
        yaw = 2 * np.pi * 3 * np.linspace(0.0, 1.0, 4000)[50 * i]
        true_x, true_y, _ = rotation(yaw, 0.0, 0.0) @ FIELD_UT
        off.append(np.degrees(np.angle(np.exp(1j * (np.arctan2(y, x) - np.arctan2(true_y, true_x))))))
    return off


@pytest.mark.parametrize("seed", range(5))
def test_known_bias_scale_and_irons_are_found(seed: int) -> None:
    errors = Errors()
    found = fit(samples(errors, seed))
    assert found.gyro_bias_radps == pytest.approx(errors.gyro_bias, abs=0.001)
    assert found.acc_scale == pytest.approx(errors.acc_scale, abs=0.002)
    assert found.mag_offset_ut == pytest.approx(errors.hard_iron, abs=0.5)
    assert max(map(abs, heading_errors_deg(found, errors))) < 2.0


def test_without_a_calibration_the_same_sensor_is_far_off() -> None:
    assert max(map(abs, heading_errors_deg(Calibration(), Errors()))) > 30.0


@pytest.mark.parametrize("seed", range(3))
def test_a_vehicle_that_only_turns_gets_its_plane_calibrated(seed: int) -> None:
    plane = np.array([[1.2, 0.1, 0.0], [0.1, 0.9, 0.0], [0.0, 0.0, 1.0]])
    errors = Errors(soft_iron=plane)
    found = fit(samples(errors, seed, tilt_rad=0.02))
    assert found.mag_offset_ut[:2] == pytest.approx(errors.hard_iron[:2], abs=1.0)
    assert found.mag_offset_ut[2] == 0.0
    assert found.mag_matrix[2] == (0.0, 0.0, 1.0)
    assert max(map(abs, heading_errors_deg(found, errors))) < 3.0


def test_a_tag_without_a_magnetometer_gets_bias_and_scale() -> None:
    found = fit([sample._replace(mag=None) for sample in samples(Errors(), 1)])
    assert not found.has_mag
    assert found.label == "calibrated=gyro+acc"
    assert found.gyro_bias_radps == pytest.approx(Errors().gyro_bias, abs=0.001)


@pytest.mark.parametrize(
    ("measured", "why"),
    [
        (samples(Errors(), 1, rest_s=0.0), "did not rest"),
        (samples(Errors(), 1, turns=0.4, tilt_rad=0.02), "turn the tag further"),
        (samples(Errors(), 1)[:600], "turn the tag"),
        (samples(Errors(mag_noise_ut=8.0), 1), "the magnetic field changes"),
        (samples(Errors(hard_iron=(0.0, 0.0, 0.0), soft_iron=6 * np.eye(3)), 1), "is not the Earth's"),
        ([], "did not rest: no IMU sample arrived"),
        ([one._replace(t_ns=5) for one in samples(Errors(), 1)], "did not rest: the samples cover 0.0 s"),
        (samples(Errors(), 1)[:500:20], "did not rest: 5 samples per second are too few; 10 are needed"),
        (samples(Errors(acc_scale=9.80665), 1)[:500], r"it reads 1.00 m/s² and 0.03 rad/s; .* check the units"),
        (samples(Errors(gyro_bias=(1.2, 0.0, 0.0)), 1)[:500], r"it reads 9.61 m/s² and 1.20 rad/s; .* check the units"),
        (samples(Errors(), 1)[600:], r"the gyroscope varies by .* less than 0.03 and 0.25 is rest; leave it alone"),
    ],
)
def test_samples_that_do_not_suffice_say_what_to_do(measured: list[ImuSample], why: str) -> None:
    with pytest.raises(NotEnoughError, match=why):
        fit(measured)


def test_a_person_is_guided_and_the_stream_ends_when_it_suffices(capsys: pytest.CaptureFixture[str]) -> None:
    everything = samples(Errors(), 2)
    used = Guide("a list").collect(iter(everything))
    assert len(used) < len(everything)
    fit(used)
    said = capsys.readouterr().err
    assert said.index("Leave the tag alone") < said.index("Now turn it") < said.index("Turn the tag")


def test_lines_on_a_pipe_that_stays_open_are_calibrated_as_soon_as_they_suffice(tmp_path: Path) -> None:
    process = start_python("-m", "dropanchor_tag_client", "calibrate", str(tmp_path))
    assert process.stdin is not None
    assert process.stderr is not None
    try:
        assert process.stderr.readline() == "Leave the tag alone.\n"
        assert process.stderr.readline().startswith("No IMU sample yet. Waiting for lines on standard input")
        moving, everything = samples(Errors(), 3)[600:1200], samples(Errors(), 3)
        process.stdin.write("".join(f"{line(one)}\n" for one in moving))
        process.stdin.flush()
        seen = next(text for text in process.stderr if "samples, " in text)
        assert "The tag did not rest: the gyroscope varies by" in seen
        later = [one._replace(t_ns=one.t_ns + 60_000_000_000) for one in everything]
        with pytest.raises(BrokenPipeError):  # it ends before it has read all of them
            process.stdin.write("".join(f"{line(one)}\n" for one in later))
        assert process.wait(PATIENCE_S) == 0
        assert read_calibration(tmp_path) is not None
    finally:
        process.kill()
        process.communicate()


def test_lines_are_calibrated_into_a_folder_and_a_program_with_it_publishes_corrected_samples(
    router_endpoint: str, tmp_path: Path
) -> None:
    measured = samples(Errors(), 3)
    text = "\n".join(line(sample) for sample in measured)
    done = python("-m", "dropanchor_tag_client", "calibrate", str(tmp_path), text_input=text)
    assert done.returncode == 0, done.stderr
    assert "hard iron" in done.stderr
    found = read_calibration(tmp_path)
    assert found is not None
    received: list[zenoh.Sample] = []
    with connected_session(router_endpoint) as session:
        session.declare_subscriber(keys.all_tags("default", "samples"), received.append)
        make_known(session)
        arguments = ("--tag", "a", "--connect", router_endpoint, "--calibration", str(tmp_path))
        sent = python("-m", "dropanchor_tag_client", "publish", *arguments, text_input=line(measured[-1]))
        assert sent.returncode == 0, sent.stderr
        wait_until(lambda: received)
    assert str(received[0].encoding) == "application/vnd.dropanchor.samples;calibrated=gyro+acc+mag"
    frame = decode_packed(bytes(received[0].payload))
    assert not isinstance(frame, tuple)
    assert frame.imu[0].mag == pytest.approx(found.applied(measured[-1]).mag, rel=1e-5)
    assert frame.imu[0].gyro == pytest.approx(found.applied(measured[-1]).gyro, rel=1e-5)


def test_a_chip_is_calibrated_in_the_axes_of_the_tag(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    everything = samples(Errors(), 4)
    measured = everything[:350] + everything[500::10]

    def of_chip(v: Vector) -> Vector:
        return v[1], -v[0], v[2]

    chip = [(of_chip(one.acc), of_chip(one.gyro), of_chip(one.mag or one.acc)) for one in measured]
    FakeLibraries(monkeypatch, lambda: iter(chip))
    assert main(["calibrate", str(tmp_path), "--device", "bno055", "--forward=-y", "--rate", "100"]) == 0
    found = read_calibration(tmp_path)
    assert found is not None
    assert found.mag_offset_ut == pytest.approx(Errors().hard_iron, abs=1.5)


def test_the_service_uses_messages_whose_encoding_says_that_they_are_calibrated(tmp_path: Path) -> None:
    bench = IngestBench(tmp_path)
    sample = ImuSample(1_800_000_000_000_000_000, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0))
    for sequence in (0, 1):
        payload = encode_packed(Frame(imu=[sample], sequence=sequence, boot_id=5))
        bench.put("a", payload, f"{ENCODING_PACKED};{FOUND.label}")
    bench.ingest.turn()
    assert bench.rejected() == {}
    assert bench.total(bench.metrics.samples, kind="imu") == 2


def test_a_calibration_is_read_as_it_was_written(tmp_path: Path) -> None:
    assert read_calibration(tmp_path) is None
    write_calibration(tmp_path / "new", FOUND)
    assert read_calibration(tmp_path / "new") == FOUND


@pytest.mark.parametrize("change", [{"acc_scale": "one"}, {"mag_matrix": [1]}, {"version": 2}, {"more": 1}])
def test_a_damaged_calibration_is_refused(tmp_path: Path, change: dict[str, object]) -> None:
    path = write_calibration(tmp_path, FOUND)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(CalibrationError, match="run `dropanchor-tag calibrate` again"):
        read_calibration(tmp_path)
    path.write_text("{")
    with pytest.raises(CalibrationError, match=FILE_NAME):
        read_calibration(tmp_path)


def test_calibrating_a_sample_removes_bias_scale_and_irons() -> None:
    sample = ImuSample(5, (1.0, 2.0, 3.0), (0.1, 0.2, 0.4), (2.0, 4.0, 4.0))
    found = FOUND.applied(sample)
    assert found.acc == (2.0, 4.0, 6.0)
    assert found.gyro == pytest.approx((0.0, 0.0, 0.1))
    assert found.mag == (1.0, 1.0, 2.0)
    assert FOUND.applied(sample._replace(mag=None)).mag is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["publish", "--tag", "a", "--calibration", "/tmp/nothing"], "holds no calibration"),
        (["calibrate", "/proc/x", "--device", "bno055", "--forward", "x", "--up", "x"], "must be different axes"),
    ],
)
def test_an_error_prints_a_message_and_exits_with_code_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    FakeLibraries(monkeypatch, lambda: iter(()))
    assert main(arguments) == 2
    assert message in capsys.readouterr().err
