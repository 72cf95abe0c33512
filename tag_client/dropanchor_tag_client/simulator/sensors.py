"""All sensor models of a simulated tag, and presets by name."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from dropanchor_tag_client.simulator.azimuth import AzimuthModel
from dropanchor_tag_client.simulator.heading_error import HeadingErrorModel
from dropanchor_tag_client.simulator.imu import ImuModel
from dropanchor_tag_client.simulator.ranging import AnchorPlace, RangeModel
from dropanchor_tag_client.simulator.scalar import ScalarModel


@dataclass(frozen=True)
class SensorModels:
    """All sensors of a tag. azimuth: of its anchors; None: they measure none.

    mount_rad: course minus body yaw. height_m: height of the tag on the anchors' z axis. first_seen_s: time between the
    first motion and the first sample; None: the samples start with the run.
    """

    ranges: RangeModel = field(default_factory=RangeModel)
    scalar: ScalarModel = field(default_factory=ScalarModel)
    imu: ImuModel = field(default_factory=ImuModel)
    heading_error: HeadingErrorModel = field(default_factory=HeadingErrorModel)
    azimuth: AzimuthModel | None = None
    anchors: tuple[AnchorPlace, ...] = (AnchorPlace(),)
    mount_rad: float = 0.0
    height_m: float = 0.0
    first_seen_s: float | None = None


def noiseless() -> SensorModels:
    """Return perfect sensors on a body without lean or vibration."""
    return SensorModels(
        ranges=RangeModel(std=0.0),
        scalar=ScalarModel(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        imu=ImuModel(
            acc_std=0.0,
            acc_bias_std=0.0,
            acc_scale_std=0.0,
            gyro_std=0.0,
            gyro_bias_std=0.0,
            gyro_wander_std=0.0,
            mag_std=0.0,
            hard_iron_std=0.0,
            soft_iron_std=0.0,
            rocking_std=0.0,
            lean_std=0.0,
            vibration_acc=0.0,
            vibration_gyro=0.0,
        ),
    )


def with_noise(range_std: float, heading_std: float, range_hz: float | None = None) -> SensorModels:
    """Return the default sensors with this white range noise, m, white heading noise, rad, and range rate, Hz."""
    return SensorModels(ranges=RangeModel(hz=range_hz, std=range_std), scalar=ScalarModel(heading_std=heading_std))


def calibrated(models: SensorModels) -> SensorModels:
    """Return the sensors with a calibrated magnetometer, which keeps a small residual iron error."""
    return replace(models, imu=replace(models.imu, hard_iron_std=0.5, soft_iron_std=0.01))


# paper: the noise stated in the paper. released: the actual noise of the authors' released data. real: a DW1000-class
# tag. calibrated: the same with a calibrated magnetometer. none: perfect sensors.
PRESETS: Mapping[str, SensorModels] = MappingProxyType(
    {
        "paper": with_noise(0.2, 0.1),
        "released": with_noise(0.005, 0.01),
        "real": with_noise(0.1, 0.05, range_hz=10.0),
        "calibrated": calibrated(with_noise(0.1, 0.05, range_hz=10.0)),
        "none": noiseless(),
    }
)


def preset(name: str, range_hz: float | None = None, imu_hz: float | None = None) -> SensorModels:
    """Return the preset of this name, optionally with other rates. Raises ValueError for an unknown name."""
    if name not in PRESETS:
        raise ValueError(f"there is no noise {name!r}; there are {', '.join(PRESETS)}")
    models = PRESETS[name]
    ranges = models.ranges if range_hz is None else replace(models.ranges, hz=range_hz)
    imu = models.imu if imu_hz is None else replace(models.imu, hz=imu_hz)
    return replace(models, ranges=ranges, imu=imu)
