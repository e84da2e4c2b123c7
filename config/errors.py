"""The one error that bad input raises: it names the place and the remedy, and becomes exit code 2."""

from __future__ import annotations


class InputError(Exception):
    """Bad input of a user: a file, a key, a column, a motion, a bus.

    The message is one sentence fit to be shown as it is.
    """

    def __init__(self, place: str, problem: str, remedy: str = "") -> None:
        self.place, self.problem, self.remedy = place, problem, remedy
        super().__init__(f"{place}: {problem}" + (f"; {remedy}" if remedy else ""))
