"""The one error that bad input raises: it names the place and the remedy, and becomes exit code 2."""

from __future__ import annotations


class InputError(Exception):
    """Bad input of a user: a file, a key, a column, a motion, a bus.

    The message is one sentence fit to be shown as it is.
    """

    def __init__(self, place: str, problem: str, remedy: str = "") -> None:
        self.place, self.problem, self.remedy = place, problem, remedy
        super().__init__(f"{place}: {problem}" + (f"; {remedy}" if remedy else ""))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str]]:
        return type(self), (self.place, self.problem, self.remedy)


class WrongKey(ValueError):
    """What a validator of a typed section raises: the key (a path below the section), the problem, the remedy."""

    def __init__(self, key: str, problem: str, remedy: str = "") -> None:
        self.key, self.problem, self.remedy = key, problem, remedy
        super().__init__(f"{key}: {problem}" + (f"; {remedy}" if remedy else ""))
