"""Checks of errors and warnings: of their type, and of the names and numbers in their message, not
of its sentences.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

NUMBER = re.compile(r"(?<![\w.])-?(?:\d+\.?\d*(?:e[-+]?\d+)?|nan\b|inf\b)(?!\w)")


@contextmanager
def raises(
    kind: type[BaseException], *wanted: str | float
) -> Iterator[pytest.ExceptionInfo[BaseException]]:
    """Check that an error of exactly this type is raised, and that its message has these names and
    numbers.
    """
    with pytest.raises(kind) as caught:
        yield caught
    assert caught.type is kind, f"a {caught.type.__name__}, not a {kind.__name__}: {caught.value}"
    assert missing(str(caught.value), *wanted) == [], caught.value


@contextmanager
def warns(kind: type[Warning], *wanted: str | float) -> Iterator[None]:
    """Check that a warning of this type is given with these names and numbers in its message."""
    with pytest.warns(kind) as caught:
        yield
    said = [str(warning.message) for warning in caught if warning.category is kind]
    assert any(missing(message, *wanted) == [] for message in said), said


def refused(call: Callable[[], object], kind: type[BaseException], *wanted: str | float) -> None:
    """Check that a call raises an error of exactly this type, with these names and numbers in its
    message.
    """
    with raises(kind, *wanted):
        call()


def missing(message: str, *wanted: str | float) -> list[str | float]:
    """Of these words and numbers, those that are not in the message: a word is there as a whole, a
    number by its value.
    """
    numbers = {str(float(number)) for number in NUMBER.findall(message)}
    return [
        each
        for each in wanted
        if not (
            re.search(rf"(?<!\w){re.escape(each)}(?!\w)", message)
            if isinstance(each, str)
            else str(float(each)) in numbers
        )
    ]
