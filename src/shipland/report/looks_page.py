"""One HTML page of what a detector misses, takes for a target, and finds, in pictures; it stands alone."""

from __future__ import annotations

import html
from collections.abc import Sequence

import cv2
import numpy as np

from shipland.learning.looks import Look
from shipland.report.pages import page, picture
from shipland.vision.pictures import Picture, read_picture

_MOST_SHOWN = 24
"""Pictures of each kind; the page's size is bounded by it."""
_SIDE_PX = 240
_LEAST_VIEW_PX = 64.0
"""Of a picture at least so much about a box is shown."""
_TARGET_BGR, _FALSE_BGR, _HIT_BGR = (60, 200, 255), (60, 60, 255), (80, 230, 40)
_FIGURES = """.looks{display:flex;flex-wrap:wrap;gap:12px}
figure{margin:0;width:240px}figure img{width:100%;display:block}
figcaption{font-size:12px;color:var(--dim);overflow-wrap:anywhere}"""


def looks_page(looks: Sequence[Look], confidence: float, title: str, summary: str) -> str:
    """The page: missed targets, false boxes (the surest first) and hits (the least sure first), each cut out."""
    missed, false, hits = [], [], []
    for look in looks:
        sure = look.above(confidence)
        for index in sure.missed:
            near = look.scores[look.verdict == index]
            words = f"best box {float(near.max()):.2f}" if len(near) else "no box"
            missed.append((-float(look.targets[index, 3:5].max()), sure, look.targets[index, 1:5], words))
        for box, score, verdict in zip(sure.boxes, sure.scores, sure.verdict, strict=True):
            if verdict == -1:
                false.append((-float(score), sure, box, f"{score:.2f}"))
            elif verdict >= 0:
                hits.append((float(score), sure, box, f"{score:.2f}"))
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        f'<p class="dim">{html.escape(summary)}</p>',
        '<p><span class="key"><i style="background:#ffc83c"></i>labelled</span>'
        '<span class="key"><i style="background:#28e650"></i>box on a label</span>'
        '<span class="key"><i style="background:#ff3c3c"></i>box on none</span></p>',
    ]
    for name, order, found in (
        ("Missed", "the largest first", missed),
        ("False boxes", "the surest first; one on a target is a missing label", false),
        ("Detections", "the least sure first", hits),
    ):
        shown = sorted(found, key=lambda row: row[0])[:_MOST_SHOWN]
        parts.append(f"<h2>{name}: {len(found)}</h2>")
        parts.append(f'<p class="dim">{order}; {len(shown)} shown.</p>' if found else "<p>None.</p>")
        figures = "".join(_figure(look, np.asarray(box, float), words) for _, look, box, words in shown)
        parts.append(f'<div class="looks">{figures}</div>')
    return page(title, parts, _FIGURES)


def _figure(look: Look, box: np.ndarray[tuple[int], np.dtype[np.float64]], words: str) -> str:
    view = _view(read_picture(look.path), look, box)
    jpeg = cv2.imencode(".jpg", view, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes()
    caption = f"{words}, {box[2]:.0f} × {box[3]:.0f} px<br>{html.escape(look.path.name)}"
    return f"<figure>{picture(jpeg, 'jpeg', '')}<figcaption>{caption}</figcaption></figure>"


def _view(picture: Picture, look: Look, box: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Picture:
    """A square about a box, three times as wide where there is room, with what is labelled and found in it."""
    size = np.array(picture.shape[1::-1], float)
    side = min(max(3.0 * float(box[2:].max()), _LEAST_VIEW_PX), float(size.max()))
    scale = _SIDE_PX / side
    corner = np.minimum(np.maximum(box[:2] - 0.5 * side, 0.0), np.maximum(size - side, 0.0))
    place = np.array([[scale, 0.0, -scale * corner[0]], [0.0, scale, -scale * corner[1]]])
    view = cv2.warpAffine(picture, place, (_SIDE_PX, _SIDE_PX), flags=cv2.INTER_LINEAR, borderValue=(40, 40, 40))
    frames = [(target[1:5], _TARGET_BGR) for target in look.targets]
    colours = [_FALSE_BGR if verdict == -1 else _HIT_BGR for verdict in look.verdict]
    for frame, colour in [*frames, *zip(look.boxes, colours, strict=True)]:
        ends = (scale * (frame[:2] + sign * 0.5 * frame[2:] - corner) for sign in (-1.0, 1.0))
        low, high = (np.clip(np.round(end), -9, 999).astype(int).tolist() for end in ends)
        cv2.rectangle(view, low, high, colour, 1, cv2.LINE_AA)
    return np.asarray(view, np.uint8)
