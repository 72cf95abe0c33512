"""Filters of topics, as in MQTT."""

_MAX_BYTES = 65_535


def matches(pattern: str, topic: str) -> bool:
    """Return whether an MQTT topic matches a filter."""
    wanted, levels = pattern.split("/"), topic.split("/")
    if wanted[-1] == "#":
        wanted.pop()
        levels = levels[: len(wanted)]
    return len(wanted) == len(levels) and all(a in ("+", b) for a, b in zip(wanted, levels, strict=True))


def wildcards_in(pattern: str, topic: str) -> list[str]:
    """Return what each + of a filter stands for in a topic that it matches."""
    return [level for wanted, level in zip(pattern.split("/"), topic.split("/"), strict=False) if wanted == "+"]


def is_filter(pattern: str) -> bool:
    """Return whether a broker accepts a filter: + and # are whole levels, and # is the last one."""
    levels = pattern.split("/")
    whole = all(level in ("+", "#") or not {"+", "#", "\0"} & {*level} for level in levels)
    return 0 < len(pattern.encode()) <= _MAX_BYTES and whole and "#" not in levels[:-1]
