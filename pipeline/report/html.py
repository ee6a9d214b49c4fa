"""The parts of a self-contained page: figures inlined, tables, bars. Every text given is escaped here."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape

from . import style

STYLE = f"""
:root {{ --paper: {style.PAPER}; --ink: {style.INK}; --soft: {style.SOFT}; --line: {style.LINE};
  --accent: {style.ACCENT}; --warm: {style.WARM}; }}
* {{ box-sizing: border-box; }}
body {{ margin: 0; background: var(--paper); color: var(--ink); line-height: 1.55;
  font: 400 16px/1.55 Inter, "Helvetica Neue", Arial, sans-serif; -webkit-font-smoothing: antialiased; }}
main {{ max-width: 1080px; margin: 0 auto; padding: 64px 32px 96px; }}
h1, h2 {{ font-family: Georgia, "Times New Roman", "DejaVu Serif", serif; font-weight: 400; letter-spacing: -0.01em; }}
h1 {{ font-size: 44px; line-height: 1.12; margin: 10px 0 18px; }}
h2 {{ font-size: 28px; line-height: 1.2; margin: 0 0 10px; }}
section {{ margin-top: 72px; padding-top: 28px; border-top: 1px solid var(--line); }}
p {{ max-width: 44em; margin: 0 0 14px; }}
.soft {{ color: var(--soft); font-size: 14.5px; margin: 18px 0 0; }}
.kicker {{ color: var(--accent); font-size: 13px; letter-spacing: 0.12em; text-transform: uppercase; margin: 0; }}
.lead {{ font-size: 19px; line-height: 1.5; }}
.facts {{ display: flex; flex-wrap: wrap; gap: 14px 48px; margin: 30px 0 8px; padding: 0; list-style: none; }}
.facts b {{ display: block; font: 400 30px/1.1 Georgia, "DejaVu Serif", serif; }}
.facts span {{ color: var(--soft); font-size: 14px; }}
.row {{ display: grid; gap: 24px; margin: 26px 0 8px; align-items: start; }}
figure {{ margin: 0; }}
figure img {{ display: block; width: 100%; height: auto; }}
figure img.pixels {{ image-rendering: pixelated; }}
figure img.dark {{ background: #0d0e10; }}
figure img.scale {{ width: 230px; max-width: 100%; margin: 10px auto 0; }}
.strip {{ gap: 12px; margin: 10px 0 26px; }}
figcaption {{ color: var(--soft); font-size: 13.5px; line-height: 1.4; margin-top: 9px; min-height: 2.8em; }}
figcaption b {{ color: var(--ink); font-weight: 600; }}
table {{ border-collapse: collapse; width: 100%; margin: 20px 0 8px; font-size: 15px; }}
th {{ text-align: left; font-weight: 500; color: var(--soft); font-size: 13px; border-bottom: 1px solid var(--ink); }}
th, td {{ padding: 9px 18px 9px 0; vertical-align: baseline; }}
td {{ border-bottom: 1px solid var(--line); }}
td.number, th.number {{ text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }}
td code {{ font: 13px/1.4 "SF Mono", Menlo, Consolas, "DejaVu Sans Mono", monospace; color: var(--soft); }}
.bars {{ margin: 22px 0; }}
.bar {{ display: grid; grid-template-columns: 300px 1fr 84px; gap: 16px; align-items: center;
  padding: 5px 0; font-size: 15px; }}
.bar div {{ background: var(--accent); height: 10px; min-width: 1px; }}
.bar span:last-child {{ text-align: right; font-variant-numeric: tabular-nums; }}
.two td, .two th {{ padding-right: 12px; font-size: 14px; }}
.two {{ display: grid; grid-template-columns: 1fr 1.1fr; gap: 40px; align-items: start; }}
footer {{ margin-top: 72px; padding-top: 20px; border-top: 1px solid var(--line);
  color: var(--soft); font-size: 13.5px; }}
@media (max-width: 760px) {{ .row, .two {{ grid-template-columns: 1fr 1fr !important; }} h1 {{ font-size: 34px; }} }}
@media print {{ section {{ break-inside: avoid; }} }}
"""


def page(title: str, parts: Sequence[str]) -> str:
    """Return a whole HTML document."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n<body><main>\n"
        + "\n".join(parts)
        + "\n</main></body></html>\n"
    )


def section(title: str, *parts: str) -> str:
    """Return a section with its heading."""
    return f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def text(words: str, kind: str = "") -> str:
    """Return a paragraph."""
    return f"<p{_class(kind)}>{escape(words)}</p>"


def figure(png: bytes, title: str, words: str, kind: str = "", scale: bytes | None = None) -> str:
    """Return a picture with its caption, and a colour scale between them.

    ``kind`` ``"pixels"`` shows pixels as squares, ``"dark"`` puts a dark ground under transparent parts.
    """
    below = f'<img class="scale" alt="colour scale" src="{_uri(scale)}">' if scale is not None else ""
    caption = f"<figcaption><b>{escape(title)}</b> {escape(words)}</figcaption>" if title or words else ""
    alternative = escape(f"{title} {words}".strip() or "picture")
    return f'<figure><img{_class(kind)} alt="{alternative}" src="{_uri(png)}">{below}{caption}</figure>'


def row(figures: Sequence[str], kind: str = "row") -> str:
    """Return figures side by side in equal columns; ``kind`` ``"row strip"`` sets them closer."""
    return f'<div class="{kind}" style="grid-template-columns:repeat({len(figures)}, 1fr)">{"".join(figures)}</div>'


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int]) -> str:
    """Return a table; the columns in ``numbers`` are set to the right, words between backticks are set as names."""

    def cell(tag: str, column: int, words: str) -> str:
        return f"<{tag}{_class('number' if column in numbers else '')}>{_with_code(words)}</{tag}>"

    head = "".join(cell("th", i, words) for i, words in enumerate(heads))
    body = "".join("<tr>" + "".join(cell("td", i, words) for i, words in enumerate(line)) + "</tr>" for line in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def bars(entries: Sequence[tuple[str, float, str]]) -> str:
    """Return horizontal bars: words, length, and what stands at the end."""
    longest = max(abs(length) for _, length, _ in entries) or 1.0
    lines = [
        f'<div class="bar"><span>{escape(words)}</span><div style="width:{100 * abs(length) / longest:.1f}%"></div>'
        f"<span>{escape(end)}</span></div>"
        for words, length, end in entries
    ]
    return f'<div class="bars">{"".join(lines)}</div>'


def facts(entries: Sequence[tuple[str, str]]) -> str:
    """Return a few large figures with what they mean."""
    lines = "".join(f"<li><b>{escape(value)}</b><span>{escape(words)}</span></li>" for value, words in entries)
    return f'<ul class="facts">{lines}</ul>'


def _with_code(words: str) -> str:
    parts = escape(words).split("`")
    return "".join(f"<code>{part}</code>" if i % 2 else part for i, part in enumerate(parts))


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


def _uri(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode()
