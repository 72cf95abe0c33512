"""Units of the columns, and their factors to SI (the magnetic field: to µT)."""

import math
import re
from typing import NamedTuple

from dropanchor_service.importing.readings import ACC, GYRO, HEADING, MAG, PRESSURE, RANGE, TIME, TRUTH, ImportingError

G_MPS2 = 9.80665  # standard gravity, ISO 80000-3
INCH_M = 0.0254
COMPASS, ISO = "deg_compass", "iso"

SI = {ACC: "m/s2", GYRO: "rad/s", MAG: "uT", RANGE: "m", HEADING: "rad", TIME: "s", PRESSURE: "Pa", TRUTH: "m"}
_FACTORS: dict[str, dict[str, float]] = {
    ACC: {"m/s2": 1.0, "g": G_MPS2, "mg": G_MPS2 / 1e3, "cm/s2": 0.01, "mm/s2": 1e-3},
    GYRO: {"rad/s": 1.0, "deg/s": math.pi / 180, "mdeg/s": math.pi / 180e3, "mrad/s": 1e-3, "rpm": math.pi / 30},
    MAG: {"uT": 1.0, "nT": 1e-3, "mT": 1e3, "T": 1e6, "gauss": 100.0, "mgauss": 0.1},
    RANGE: {"m": 1.0, "cm": 0.01, "mm": 1e-3, "km": 1e3, "ft": 12 * INCH_M, "in": INCH_M},
    HEADING: {"rad": 1.0, "deg": math.pi / 180, COMPASS: -math.pi / 180},
    PRESSURE: {"Pa": 1.0, "hPa": 100.0, "kPa": 1e3},
    TIME: {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0, "min": 60e9, ISO: 1.0},
}
_ALIASES: dict[str, dict[str, str]] = {
    ACC: dict.fromkeys(("ms2", "ms-2", "mps2", "m/s/s", "mpss", "m/s2", "meterspersecondsquared"), "m/s2")
    | dict.fromkeys(("gs", "gee", "gn", "g0"), "g")
    | dict.fromkeys(("milli-g", "millig", "mgee"), "mg"),
    GYRO: dict.fromkeys(("rads", "rads-1", "radps", "rad", "rps", "radians/s", "radpersec"), "rad/s")
    | dict.fromkeys(("degs", "degs-1", "degps", "dps", "deg", "°/s", "°s-1", "°", "°ps", "degpersec"), "deg/s")
    | dict.fromkeys(("mdps", "mdegs", "mdegps"), "mdeg/s"),
    MAG: dict.fromkeys(("microtesla", "utesla"), "uT")
    | dict.fromkeys(("tesla",), "T")
    | dict.fromkeys(("g", "gs", "ga"), "gauss")
    | dict.fromkeys(("mg", "mga", "milligauss"), "mgauss"),
    RANGE: dict.fromkeys(("meter", "meters", "metre", "metres"), "m")
    | dict.fromkeys(("feet", "foot"), "ft")
    | dict.fromkeys(("inch", "inches"), "in"),
    HEADING: dict.fromkeys(("degree", "degrees", "°"), "deg") | dict.fromkeys(("radian", "radians"), "rad"),
    PRESSURE: dict.fromkeys(("mbar", "mb", "millibar", "hectopascal"), "hPa") | dict.fromkeys(("pascal",), "Pa"),
    TIME: dict.fromkeys(("sec", "secs", "second", "seconds"), "s")
    | dict.fromkeys(("msec", "msecs", "millis", "millisecond", "milliseconds"), "ms")
    | dict.fromkeys(("usec", "usecs", "micros", "microsecond", "microseconds"), "us")
    | dict.fromkeys(("nsec", "nsecs", "nanos", "nanosec", "nanosecond", "nanoseconds"), "ns"),
}
_FACTORS[TRUTH], _ALIASES[TRUTH] = _FACTORS[RANGE], _ALIASES[RANGE]
_SCALED = re.compile(r"(.+)([*/])\s*([-+0-9.eE]+)")
_SUPERSCRIPT = str.maketrans(
    {"²": "2", "⁻": "-", "¹": "1", "µ": "u", "μ": "u", "^": None, " ": None, "·": None, "*": None}
)


class Conversion(NamedTuple):
    """value in SI = factor · value + offset. name: of the unit, as `--map` takes it."""

    name: str
    factor: float
    offset: float = 0.0

    @property
    def is_si(self) -> bool:
        return self.factor == 1.0 and self.offset == 0.0


def conversion(text: str, quantity: str) -> Conversion:
    """Return the conversion of a unit, as `g`, `deg/s` or `g/16384` (counts). Raises ImportingError."""
    found = known(text, quantity)
    if found is None:
        raise ImportingError(
            f"{text!r} is not a known unit: of {_WHAT[quantity]}, the known ones are {', '.join(_FACTORS[quantity])}, "
            f"and any of them with a number, as {SI[quantity]}*0.5 or {SI[quantity]}/16384"
        )
    return found


def known(text: str, quantity: str) -> Conversion | None:
    """Return the conversion of a unit, None if it is not known."""
    name = _name(text, quantity)
    if name is not None:
        return Conversion(name, _FACTORS[quantity][name], math.pi / 2 if name == COMPASS else 0.0)
    scaled = _SCALED.fullmatch(text.strip())
    name = _name(scaled[1], quantity) if scaled else None
    if scaled is None or name is None or name == COMPASS:
        return None
    try:
        number = float(scaled[3])
    except ValueError:
        return None
    if number == 0.0 or not math.isfinite(number):
        return None
    factor = _FACTORS[quantity][name] * (number if scaled[2] == "*" else 1.0 / number)
    return Conversion(f"{name}{scaled[2]}{scaled[3]}", factor)


def _name(text: str, quantity: str) -> str | None:
    if text in _FACTORS[quantity]:
        return text
    plain = text.translate(_SUPERSCRIPT).lower()
    same = next((name for name in _FACTORS[quantity] if name.lower() == plain), None)
    return same or _ALIASES[quantity].get(plain)


_WHAT = {
    ACC: "an acceleration",
    GYRO: "a turn rate",
    MAG: "a magnetic field",
    RANGE: "a range",
    HEADING: "a heading",
    TIME: "a time",
    PRESSURE: "a pressure",
    TRUTH: "a place",
}
