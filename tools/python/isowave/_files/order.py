"""The order of files of a series."""

from __future__ import annotations

import re
from typing import Any


def natural_order(name: str) -> list[Any]:
    """A key for sorting: step_2 before step_10."""
    return [int(part) if part.isdigit() else part for part in re.split(r"([0-9]+)", name)]
