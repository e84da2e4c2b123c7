"""A TOML file as a typed section: every mistake is named with file, line or key, and remedy."""

from __future__ import annotations

import re
import tomllib
import types
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from config.errors import InputError, WrongKey
from config.text_file import read_text

T = TypeVar("T", bound=BaseModel)
Location = tuple[int | str, ...]


def shown(path: Path) -> str:
    """``path`` as a person reads it: relative to the working directory where it lies below it."""
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def read_toml(path: Path) -> dict[str, Any]:
    """Read ``path``. Raises InputError for a file that is absent, unreadable, not UTF-8 or not TOML (with its line)."""
    try:
        text = read_text(path)
    except FileNotFoundError:
        raise InputError(shown(path), "there is no such file", "check the path") from None
    except UnicodeDecodeError as error:
        raise InputError(shown(path), f"is not UTF-8 text (byte {error.start})", "save it as UTF-8") from None
    except OSError as error:
        raise InputError(shown(path), f"cannot be read ({error.strerror})", "check the path and its rights") from None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        at = re.search(r" \(at (.*)\)$", str(error))
        where = f", {at[1]}" if at else ""
        reason = str(error)[: at.start()] if at else str(error)
        raise InputError(f"{shown(path)}{where}", f"is not TOML: {_lower(reason)}", "correct that line") from None


def validate(model: type[T], data: dict[str, Any], path: Path) -> T:
    """``data`` of the file ``path`` as ``model``. Raises InputError for the first mistake and counts the others."""
    try:
        return model.model_validate(with_tuples(data), strict=True)
    except ValidationError as error:
        # A misspelt key is also a missing one: say the misspelling.
        mistakes = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        key, problem, remedy = _explained(mistakes[0], model, data)
        if more := len(mistakes) - 1:
            places = ", ".join(dict.fromkeys(key_path(e["loc"], data) for e in mistakes[1:]))
            problem += f" ({more} more mistake{'s' if more > 1 else ''}, at {places})"
        raise InputError(f"{shown(path)}: {key}" if key else shown(path), problem, remedy) from None


def with_tuples(value: Any) -> Any:
    """TOML's lists as the tuples that sections are made of: strict, so that "5" is no number, no list is a tuple."""
    if isinstance(value, dict):
        return {key: with_tuples(inner) for key, inner in value.items()}
    return tuple(map(with_tuples, value)) if isinstance(value, list) else value


def key_path(location: Sequence[int | str], data: Any) -> str:
    """``("joint", 2, "limits")`` as ``joint[2].limits (elbow)``: the entry's own name in brackets, where it has one."""
    text, named, here = "", "", data
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
        try:
            here = here[part]
        except (LookupError, TypeError):
            here = None
        if isinstance(part, int) and isinstance(here, dict) and isinstance(here.get("name"), str):
            named = here["name"]
    return f"{text} ({named})" if named else text


def nearest(word: str, known: Iterable[str]) -> str:
    """A remedy for an unknown name: the nearest known one, else all of them."""
    known = sorted(known)
    if close := get_close_matches(word, known, n=1, cutoff=0.5):
        return f"did you mean {close[0]!r}?"
    return f"known are {', '.join(known)}" if known else "none is known here"


def _explained(mistake: ErrorDetails, model: type[BaseModel], data: dict[str, Any]) -> tuple[str, str, str]:
    location, kind, context = mistake["loc"], mistake["type"], mistake.get("ctx", {})
    place = key_path(location, data)
    if kind == "extra_forbidden":
        section = _section_at(model, location[:-1])
        return (
            place,
            "is not a key of this section",
            nearest(str(location[-1]), section.model_fields if section else ()),
        )
    if kind == "missing" and isinstance(location[-1], int):
        return key_path(location[:-1], data), f"has no value number {location[-1] + 1}", "give as many as are wanted"
    if kind == "missing":
        section = _section_at(model, location[:-1])
        field = section.model_fields.get(str(location[-1])) if section else None
        table = field is not None and _sections(field.annotation)
        return place, "is missing", f"add the {'table' if table else 'key'} {location[-1]!r}"
    error = context.get("error")
    if isinstance(error, WrongKey):
        below = tuple(int(p) if p.isdigit() else p for p in re.findall(r"[^.\[\]]+", error.key))
        return key_path((*location, *below), data), error.problem, error.remedy
    if kind in ("tuple_type", "list_type"):
        return place, "must be a list", f"for tables write [[{location[-1]}]] above each"
    if kind in ("model_type", "dict_type"):
        return place, "must be a table", f"write [{'.'.join(str(p) for p in location if isinstance(p, str))}]"
    if kind == "string_pattern_mismatch":
        return place, f"{mistake['input']!r} does not match {context['pattern']}", "use a value of that form"
    if kind == "value_error":
        return place, str(error), ""
    if kind == "literal_error":
        return place, f"{mistake['input']!r} is none of {context['expected']}", "choose one of them"
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        return place, f"has {context['actual_length']} values where {wanted} are wanted", ""
    for bound, wanted in (("ge", "at least"), ("gt", "more than"), ("le", "at most"), ("lt", "less than")):
        if bound in context:
            return place, f"{mistake['input']} is out of range", f"give {wanted} {context[bound]:g}"
    if kind in ("float_type", "int_type") and isinstance(mistake["input"], str):
        return (
            place,
            f"is the text {_brief(mistake['input'])} where a number is wanted",
            "write a number, without quotes",
        )
    reason = _lower(mistake["msg"]).partition(", unable to parse")[0].replace("input should be", "must be")
    return place, f"{reason}, not {_brief(mistake['input'])}", "correct the value"


def _section_at(model: type[BaseModel], location: Location) -> type[BaseModel] | None:
    """The section type that ``location`` lies in; unions are told apart by the tag in the location."""
    candidates: list[type[BaseModel]] = [model]
    for part in location:
        if isinstance(part, int):
            continue
        found = [s for c in candidates if part in c.model_fields for s in _sections(c.model_fields[part].annotation)]
        tagged = [c for c in candidates if any(part in get_args(f.annotation) for f in c.model_fields.values())]
        candidates = found or tagged or []
    return candidates[0] if candidates else None


def _sections(annotation: Any) -> list[type[BaseModel]]:
    """The section types inside an annotation such as ``tuple[Joint, ...] | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (tuple, list, dict, Annotated, Union, types.UnionType):
        return [s for inner in get_args(annotation) for s in _sections(inner)]
    return []


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def _brief(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
