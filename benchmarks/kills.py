"""Runs that are killed at many moments, and calls that complete in many orders: more than in tests.

    python benchmarks/kills.py [--times 3]

Nothing is measured: it ends with an error where a result differs, or a recorded call is lost or
asked again.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
from tests.app.design.test_call_log import complete_in_orders, kill_and_go_on
from tests.runs.test_kills import kill_at_moments

PARTS: dict[Callable[[Path, int], None], int] = {
    complete_in_orders: 50,
    kill_and_go_on: 30,
    kill_at_moments: 40,
}
"""What is tried, and how often at a time."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--times", type=int, default=1)
    for _ in range(parser.parse_args().times):
        for part, count in PARTS.items():
            with tempfile.TemporaryDirectory() as folder:
                part(Path(folder), count)
            print(f"{part.__name__}: {count}")


if __name__ == "__main__":
    main()
