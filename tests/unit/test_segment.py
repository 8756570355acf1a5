"""Gate, opening, closing, watershed, contours: coloured regions and the quadrilaterals among them."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pictures import Look, finish, foliage
from shipland.vision.near import published
from shipland.vision.near.published import colour_mask, coloured_window, find_regions, gate, watershed_region
from shipland.vision.near.segment import Window, find_quads
from shipland.vision.parameters import VisionParameters

PARAMETERS = VisionParameters()
GREEN = (60, 190, 70)


def picture(*polygons, size=(120, 160), colour=GREEN):
    image = np.full((*size, 3), 128, np.uint8)
    for polygon in polygons:
        cv2.fillPoly(image, [np.asarray(polygon, np.int32)], colour)
    return image


def box(left, top, right, bottom):
    return [(left, top), (right, top), (right, bottom), (left, bottom)]


def regions_of(image, parameters=PARAMETERS):
    return find_regions(image, Window.whole(image), parameters)


def quads_of(image):
    return find_quads(image, regions_of(image), PARAMETERS)


@pytest.mark.parametrize(
    ("hsv", "passes"),
    [
        ((34, 200, 200), False),
        ((35, 200, 200), True),
        ((85, 200, 200), True),
        ((86, 200, 200), False),
        ((60, 69, 200), False),
        ((60, 70, 200), True),
        ((60, 200, 89), False),
        ((60, 200, 90), True),
        ((60, 255, 255), True),
    ],
)
def test_the_published_gate(hsv, passes, monkeypatch):
    # [Lee2022, §Image Filtering]: H 35–85, S 70–255, V 90–255, both ends included.
    monkeypatch.setattr("shipland.vision.near.published.cv2.cvtColor", lambda image, code: image)
    assert bool(gate(np.array([[hsv]], np.uint8), PARAMETERS)[0, 0]) is passes


def test_opening_removes_specks_and_closing_fills_voids():
    image = picture(box(40, 40, 90, 60))
    image[10, 10] = image[100, 30:33] = GREEN
    image[50, 60:62] = 128
    mask = colour_mask(image, PARAMETERS)
    wanted = np.zeros_like(mask)
    wanted[40:61, 40:91] = 255
    assert np.array_equal(mask, wanted)


def test_a_region_one_pixel_from_the_edge_is_whole():
    near, at = regions_of(picture(box(1, 30, 40, 50)))[0], regions_of(picture(box(0, 30, 40, 50)))[0]
    assert (near.cut, at.cut) == (False, True)


@given(st.integers(0, 10_000))
def test_every_second_pixel_shows_where_the_regions_are(seed):
    rng = np.random.default_rng(seed)
    image = picture()
    for _ in range(rng.integers(0, 5)):
        left, top = rng.integers(0, [150, 110])
        image[top : top + rng.integers(1, 30), left : left + rng.integers(1, 60)] = GREEN
    window = coloured_window(image, PARAMETERS)
    found = [] if window.empty else find_regions(image, window, PARAMETERS)
    every = regions_of(image)
    assert [region.contour_px.tolist() for region in found] == [region.contour_px.tolist() for region in every]


@pytest.mark.parametrize("angle_deg", [0.0, 7.0, 14.5, 30.0, 45.0, 80.0])
def test_quadrilaterals_need_not_be_upright(angle_deg):
    corners = cv2.boxPoints(((80.0, 60.0), (60.0, 20.0), angle_deg))
    (quad,) = quads_of(picture(corners))
    gaps = np.linalg.norm(quad[:, None] - corners[None], axis=2).min(axis=1)
    assert gaps.max() < 2.0  # px: what the sub-pixel corners start from; the polygon was drawn on whole pixels
    edges, after = np.roll(quad, -1, axis=0) - quad, np.roll(quad, -2, axis=0) - np.roll(quad, -1, axis=0)
    assert np.all(edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0] > 0.0)  # clockwise in the picture


@pytest.mark.parametrize(
    "polygon",
    [
        [(40, 20), (120, 60), (40, 100)],
        [(40, 20), (120, 20), (120, 50), (80, 50), (80, 100), (40, 100)],
        cv2.ellipse2Poly((80, 60), (50, 30), 0, 0, 360, 5),
    ],
    ids=["triangle", "L", "ellipse"],
)
def test_other_shapes_are_no_quadrilaterals(polygon):
    assert not quads_of(picture(polygon))


def test_a_frame_counts_by_its_outline():
    image = picture(box(40, 20, 110, 90))
    cv2.rectangle(image, (55, 35), (95, 75), (128, 128, 128), cv2.FILLED)
    assert len(quads_of(image)) == 1


def test_watershed_finds_the_boundary_that_the_gate_missed():
    image = picture(box(40, 30, 109, 79))
    image[30:80, 40:43] = (20, 85, 24)  # a shaded rim, dimmer than the gate lets pass
    region = regions_of(image)[0]
    assert region.contour_px[:, 0].min() >= 43
    flooded = watershed_region(image, region, 0.05)
    assert np.all(np.abs(flooded.contour_px.min(axis=0) - [40, 30]) <= 1)  # px
    assert np.all(np.abs(flooded.contour_px.max(axis=0) - [109, 79]) <= 1)


def test_the_published_chain_gives_the_same_quadrilateral():
    image = picture(cv2.boxPoints(((80.0, 60.0), (70.0, 30.0), 5.0)))
    published_quad, ours = (
        find(image, regions_of(image), PARAMETERS)[0] for find in (published.find_quads, find_quads)
    )
    assert np.abs(published_quad - ours).max() < 2.0  # px: the flood meets within its one-pixel margins


def test_the_printed_chain_starts_from_the_upright_bounding_rectangle():
    turned = cv2.boxPoints(((80.0, 60.0), (70.0, 30.0), 5.0))
    image = picture(turned)
    (quad,) = published.bounding_quads(image, regions_of(image), PARAMETERS)
    low, high = turned.min(axis=0), turned.max(axis=0)
    wanted = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    assert np.abs(quad - wanted).max() < 2.0  # px: the flood meets within its one-pixel margins
    assert np.abs(quad - turned[[0, 1, 2, 3]]).max() > 3.0  # no corner of the region


def test_foliage_is_bounded_work(camera, rng, monkeypatch):
    searched = []
    monkeypatch.setattr("shipland.vision.near.segment.polygon_in_outline", lambda *given: searched.append(given))
    image = finish(foliage(camera, rng), rng, Look(noise=0.0))
    regions = regions_of(image)
    assert 30 < len(regions) <= PARAMETERS.max_candidates
    find_quads(image, regions, PARAMETERS)
    assert len(searched) <= 5
