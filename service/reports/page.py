"""The frame that every report page shares: one file that needs no other, no script and no network."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from config import InputError
from service.sessions.store import write_atomically

_HERE = files(__package__)


class Html(str):
    """Text that is HTML already; plain strings are escaped when they enter a page."""

    __slots__ = ()


def html(text: str) -> Html:
    """Plain text as HTML; what is HTML already stays as it is."""
    return text if isinstance(text, Html) else Html(escape(text))


def joined(parts: Sequence[str]) -> Html:
    """Parts one after the other."""
    return Html("\n".join(html(part) for part in parts))


def element(tag: str, *content: str, of: str = "") -> Html:
    """``<tag class="of">content</tag>``."""
    attribute = f' class="{of}"' if of else ""
    return Html(f"<{tag}{attribute}>{''.join(html(part) for part in content)}</{tag}>")


def section(heading: str, *content: str) -> Html:
    """A card of the page; without a heading when that is empty."""
    return element("section", element("h2", heading) if heading else Html(""), joined(content))


def badge(kind: str, text: str = "") -> Html:
    """A coloured word: named, ambiguous, unknown, clean, good."""
    return element("span", text or kind, of=f"badge {kind}")


def table(headings: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> Html:
    """A table; ``numbers`` are the columns that line up on the right."""
    of = ["number" if k in numbers else "" for k in range(len(headings))]
    head = element("tr", *(element("th", text, of=kind) for text, kind in zip(headings, of, strict=True)))
    body = [element("tr", *(element("td", text, of=kind) for text, kind in zip(row, of, strict=True))) for row in rows]
    return element("table", element("thead", head), element("tbody", *body))


def folded(summary: str, *content: str) -> Html:
    """What a reader opens when he wants it."""
    return element("details", element("summary", summary), joined(content))


def picture(path: Path) -> Html:
    """A PNG file inside the page; nothing where it is no longer there."""
    if not path.is_file():
        return Html("")
    data = base64.b64encode(path.read_bytes()).decode()
    return element("div", Html(f'<img alt="" src="data:image/png;base64,{data}">'), of="wide")


def page(kicker: str, title: str, lead: str, facts: Mapping[str, str], sections: Sequence[str]) -> str:
    """The whole page. ``lead`` is the sentence that must be read; ``facts`` the line of small print under it."""
    frame = Template((_HERE / "page.html").read_text(encoding="utf-8"))
    return frame.substitute(
        style=(_HERE / "page.css").read_text(encoding="utf-8"),
        kicker=html(kicker),
        title=html(title),
        lead=html(lead),
        facts=Html("").join(element("span", f"{name} ", element("b", value)) for name, value in facts.items() if value),
        sections=joined(sections),
    )


def write_page(path: Path, text: str) -> None:
    """Write a page. Raises InputError when that cannot be done."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)
    except OSError as error:
        raise InputError(str(path), f"the report cannot be written ({error.strerror})", "check the directory") from None
