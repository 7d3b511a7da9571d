"""Status messages of a `LiveSimulation`, for the viewer."""

from __future__ import annotations

from floatbase._validation import as_string

# s for which the arrow of a push stays visible after the push: 0.1 s is too short to see
PUSH_DISPLAY_TIME = 0.4


def status_message(status: str, reason: str = "") -> str:
    """Return a line for the user: the status of a `LiveSimulation`, and what to do about it.

    Parameters
    ----------
    status : str
        `status` of the simulation.
    reason : str, optional
        `reason` of the simulation; only its first sentence is shown.

    Returns
    -------
    str
        The message.

    Examples
    --------
    >>> status_message("fell")
    'fell: press reset, or push again'
    """
    status, reason = as_string("status", status), as_string("reason", reason)
    if status in ("running", "paused"):
        return status
    if status == "idle":
        return "paused automatically after a long time without input: press run"
    reason = reason.split("\n")[0].split(". ")[0].rstrip(".")
    cause = f"{status}: {reason}" if reason else status
    return f"{cause}: press reset, or push again"
