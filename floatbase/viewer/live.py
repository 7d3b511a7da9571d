"""What a viewer shows of a `LiveSimulation` beside its robot."""

from __future__ import annotations

from floatbase._validation import as_string

# s for which the arrow of a push that is over is still shown: the eye misses one of 0.1 s
PUSH_DISPLAY_TIME = 0.4


def status_message(status: str, reason: str = "") -> str:
    """The `status` and `reason` of a `LiveSimulation` as one line that says what to do about it."""
    status, reason = as_string("status", status), as_string("reason", reason)
    if status in ("running", "paused"):
        return status
    if status == "idle":
        return "paused by itself, untouched for long: press run"
    reason = reason.split("\n")[0].split(". ")[0].rstrip(".")
    cause = f"{status}: {reason}" if reason else status
    return f"{cause}: press reset, or push again"
