"""What pages that stand alone are made of: the frame of a page, its tables and pictures."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from importlib import resources


def page(title: str, parts: Sequence[str], style: str = "") -> str:
    """A whole HTML page; `style` is laid over that of all pages."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{page_file('page.css')}{style}</style></head><body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def page_file(name: str) -> str:
    """`page.css` or `page.js`: what stands within the page."""
    return (resources.files("shipland") / "report" / name).read_text(encoding="utf-8")


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]], first_number: int) -> str:
    """A table whose columns from `first_number` on are numbers."""

    def line(tag: str, texts: Sequence[str]) -> str:
        return "".join(
            f"<{tag}{' class=number' if index >= first_number else ''}>{html.escape(text)}</{tag}>"
            for index, text in enumerate(texts)
        )

    body = "".join(f"<tr>{line('td', row)}</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{line("th", head)}</tr></thead><tbody>{body}</tbody></table></div>'


def html_of_table(markdown: str) -> str:
    """HTML of a Markdown table, and of the paragraphs behind it."""
    rows, words = [], []
    for line in markdown.split("\n"):
        if line.startswith("|---"):
            continue
        if line.startswith("|"):
            rows.append([text.strip() for text in line.strip().strip("|").split("|")])
        elif line:
            words.append(f'<p class="dim">{html.escape(line)}</p>')
    return html_table(rows[0], rows[1:], first_number=len(rows[0])) + "".join(words)


def picture(data: bytes, kind: str, words: str) -> str:
    """A picture within the page: the file's bytes, `png` or `jpeg`, and what it shows."""
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
    return f'<img alt="{html.escape(words, quote=True)}" src="{source}"/>'
