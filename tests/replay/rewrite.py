"""Write the golden replays anew: `PYTHONPATH=tests .venv/bin/python -m replay.rewrite [--samples]`.

The samples stay as they are unless --samples is given: what the engines make of them is then the only change, and the
diff of the expected files says what it is. Read that diff before you commit it, and say in the commit why it is right.
"""

import sys

from support.kernel_cache import use_cache_of_these_sources


def main() -> None:
    use_cache_of_these_sources()
    from replay.outputs import REPLAYS, write_expected
    from replay.samples import write_samples
    from replay.scenarios import SCENARIOS

    if "--samples" in sys.argv[1:]:
        for name, scenario in SCENARIOS.items():
            write_samples(name, scenario)
    for name, engine in REPLAYS:
        write_expected(name, engine)


if __name__ == "__main__":
    main()
