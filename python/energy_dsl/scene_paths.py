"""Values of a scene by their paths."""

from __future__ import annotations

from typing import Any


def set_value(scene: dict[str, Any], path: str, value: Any) -> None:
    """Sets the value at a path, such as "obstacles.0.friction". Numbers are places in lists."""
    *tables, last = path.split(".")
    table: Any = scene
    for name in tables:
        if isinstance(table, list):
            if not (name.isdigit() and int(name) < len(table)):
                raise ValueError(f"{path}: expected one of {len(table)} places, counted from 0, got `{name}`")
            table = table[int(name)]
        elif isinstance(table, dict):
            table = table.setdefault(name, {})
    if not isinstance(table, dict):
        raise ValueError(f"{path}: `{'.'.join(tables)}` is not a table of the scene")
    table[last] = value
