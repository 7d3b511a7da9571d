"""Change a QP inside a control step."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from floatbase.qp.problem import QP


def changed(qp: QP, **values: Any) -> QP:
    """Return a problem with other values that are known to fit, without checking them again."""
    known = {each.name: getattr(qp, each.name) for each in fields(qp)}
    return type(qp)._unchecked(**known | values)
