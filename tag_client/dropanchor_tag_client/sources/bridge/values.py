"""Numbers, units and times as devices write them."""

import math
import re
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta, tzinfo
from decimal import Decimal
from typing import Any, NamedTuple

from dropanchor_schemas.wire import MAX_T_NS
from dropanchor_tag_client.sources.bridge.places import UnusableError, shown

NS_PER = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}

_G = 9.80665
_DEGREE = math.pi / 180
_LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
_ANGLES = {"rad": 1.0, "mrad": 0.001, "deg": _DEGREE}
_ACCELERATIONS = {"m/s2": 1.0, "m/s²": 1.0, "g": _G, "mg": _G / 1000}
_RATES = {"rad/s": 1.0, "mrad/s": 0.001, "deg/s": _DEGREE, "dps": _DEGREE}
_FIELDS = {"uT": 1.0, "µT": 1.0, "nT": 0.001, "mT": 1_000.0, "T": 1e6, "G": 100.0, "mG": 0.1}
_PRESSURES = {"Pa": 1.0, "hPa": 100.0, "mbar": 100.0, "kPa": 1_000.0, "bar": 100_000.0, "inHg": 3_386.389}
UNITS: Mapping[str, Mapping[str, float]] = {
    "range_m": _LENGTHS,
    "std_m": _LENGTHS,
    "heading_rad": _ANGLES,
    "bearing_rad": _ANGLES,
    "std_rad": _ANGLES,
    "acc": _ACCELERATIONS,
    "gyro": _RATES,
    "mag": _FIELDS,
    "pressure_pa": _PRESSURES,
    "temperature_c": {"°C": 1.0, "C": 1.0},
}
"""By field, what one of each unit is in the unit of the field."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?")
_WITH_COMMA = re.compile(r"[+-]?\d+,\d+")
_DATE_LENGTH = len("2026-11-26")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class Reader(NamedTuple):
    """How a rule reads numbers and times. zone: of times that name none, None if there is none."""

    time_unit: str = "ns"
    zone: tzinfo | None = None
    decimal_comma: bool = False

    def number(self, value: Any, source: str) -> Any:
        """Return the number that a text holds, anything else as it is. Raises UnusableError."""
        if not isinstance(value, str):
            return value
        text = value.strip()
        if _WITH_COMMA.fullmatch(text):
            if not self.decimal_comma:
                raise UnusableError(
                    f"{source} is {shown(value)}: decimal_comma = true in the rule says that the comma is a decimal one"
                )
            text = text.replace(",", ".")
        return float(text) if _NUMBER.fullmatch(text) else value

    def scaled(self, value: Any, factor: float | None, source: str) -> Any:
        """Return a number in the unit of its field. Raises UnusableError."""
        number = self.number(value, source)
        if factor is None:
            return number
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise UnusableError(f"{source} is {shown(value)}, a number was expected")
        try:
            return number * factor
        except OverflowError:
            raise UnusableError(f"{source} is too large a number") from None

    def time_ns(self, value: Any, source: str) -> int:
        """Return a time, ns UTC: of a number in the unit of the rule, or of ISO 8601. Raises UnusableError."""
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise UnusableError(f"{source} is {shown(value)}, a time was expected")
        try:
            t_ns = Decimal(str(value).strip()) * NS_PER[self.time_unit]
        except (ArithmeticError, ValueError):
            return self._iso_ns(str(value).strip(), source)
        if not (t_ns.is_finite() and 0 <= t_ns < MAX_T_NS):
            raise UnusableError(f"{source} is {shown(value)}, which is no time in {self.time_unit} since 1970")
        return round(t_ns)

    def _iso_ns(self, text: str, source: str) -> int:
        try:
            time = datetime.fromisoformat(text)
        except ValueError:
            time = None
        if time is None or len(text) <= _DATE_LENGTH:
            raise UnusableError(
                f"{source} is {shown(text)}, a number or a time such as 2026-11-26T08:00:00Z was expected"
            )
        if time.tzinfo is None:
            if self.zone is None:
                raise UnusableError(
                    f'{source} is {shown(text)}, without a zone: time_zone = "UTC", or the one of the device, '
                    "in the rule says which"
                )
            time = time.replace(tzinfo=self.zone)
        try:
            t_ns = (time - _EPOCH) // timedelta(microseconds=1) * 1_000
        except OverflowError:
            t_ns = -1
        if not 0 <= t_ns < MAX_T_NS:
            raise UnusableError(f"{source} is {shown(text)}, which is before 1970 or after 2262")
        return t_ns
