"""Numbers and arrays of NumPy as those of Python, for scenes."""

from __future__ import annotations

import os
from typing import Any


def plain(value: Any) -> Any:
    """Returns the Python number or list behind a NumPy one, and the text of a path. For `json.dumps`."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"expected a number, a text, a list or a table for a scene, got {type(value).__name__}")
