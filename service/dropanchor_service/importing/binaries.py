"""Files that are known and not read: what each is, and what makes a table of it."""

from collections.abc import Sequence
from typing import NamedTuple

_CSV = "save the sheet as CSV"


class Known(NamedTuple):
    """mark: what its bytes begin with, at `at`."""

    mark: bytes
    what: str
    way_out: str
    at: int = 0


_KNOWN = (
    Known(b"\xa3\x95", "a DataFlash log of ArduPilot", "mavlogdump.py --format csv --types IMU FILE > imu.csv"),
    Known(b"ULog", "a ULog of PX4", "ulog2csv FILE"),
    Known(b"\x89HDF", "HDF5", "in Python, pandas.read_hdf(FILE).to_csv(…)"),
    Known(b"MATLAB", "a MAT file of MATLAB", "writetable(T, 'imu.csv') in MATLAB, or scipy.io.loadmat in Python"),
    Known(b"\xd0\xcf\x11\xe0", "an old Excel workbook", f"{_CSV}; phyphox exports CSV, too"),
    Known(b"\xd4\xc3\xb2\xa1", "a capture of network packets", "tshark -T fields -E separator=, -e …"),
    Known(b"\xa1\xb2\xc3\xd4", "a capture of network packets", "tshark -T fields -E separator=, -e …"),
    Known(b"\x0a\x0d\x0d\x0a", "a capture of network packets", "tshark -T fields -E separator=, -e …"),
    Known(b"\x93NUMPY", "an array of NumPy", "numpy.savetxt('imu.csv', numpy.load(FILE), delimiter=',')"),
    Known(b"\x80\x04", "a pickle of Python", "pandas.read_pickle(FILE).to_csv(…)"),
    Known(b"\x80\x05", "a pickle of Python", "pandas.read_pickle(FILE).to_csv(…)"),
    Known(b"ARROW1", "a Feather or Arrow file", "pandas.read_feather(FILE).to_parquet(…)"),
    Known(b"7z\xbc\xaf", "a 7z archive", "unpack it"),
    Known(b"Rar!", "a RAR archive", "unpack it"),
    Known(b"ustar", "a tar archive", "unpack it", 257),
    Known(b"%PDF", "a PDF", "ask for the table behind it"),
)
_IN_ARCHIVES = {
    "[content_types].xml": ("an Excel workbook", f"{_CSV}; phyphox exports CSV, too"),
    "content.xml": ("an OpenDocument sheet", _CSV),
}
HEAD_BYTES = 512


def known_as(head: bytes) -> str | None:
    """Return what a file is, and what makes a table of it, by its first bytes; None if it is not known."""
    found = next((one for one in _KNOWN if head.startswith(one.mark, one.at)), None)
    return None if found is None else f"it is {found.what}. Make a table of it first: {found.way_out}"


def archive_known_as(names: Sequence[str]) -> str | None:
    """Return the same of an archive, by the names of its files."""
    found = next((_IN_ARCHIVES[name.lower()] for name in names if name.lower() in _IN_ARCHIVES), None)
    return None if found is None else f"it is {found[0]}. Make a table of it first: {found[1]}"
