"""Messages with ranges, for the tests of the ingest."""

from dropanchor_schemas.wire import Frame, RangeSample

T = 1_760_000_000_000_000_000
S = 1_000_000_000


def ranges(*values: float, anchor: int = 7, sequence: int | None = None, boot_id: int | None = None) -> Frame:
    """Return a message with these ranges, 1 ms apart from T on."""
    samples = [RangeSample(T + i * 1_000_000, anchor, value) for i, value in enumerate(values)]
    return Frame(ranges=samples, sequence=sequence, boot_id=boot_id)
