"""The page is whole by itself, and says what it was given and nothing as code."""

from __future__ import annotations

import io
from html.parser import HTMLParser

import matplotlib.image
import numpy as np
import pytest

from pipeline.core.shape.mesh import relief
from pipeline.core.tradeoff import Trial
from pipeline.report import figures, html, style
from pipeline.report.demo import length, ranks
from tests import synthetic


class Reader(HTMLParser):
    """Collects sources and checks that every element is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.words: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = dict(attributes)
        self.sources += [str(values[name]) for name in ("src", "href") if name in values]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def pixels(png: bytes) -> np.ndarray:
    return np.asarray(matplotlib.image.imread(io.BytesIO(png), format="png"))


def test_a_page_is_closed_escaped_and_needs_nothing_else() -> None:
    picture = html.figure(b"png", "<b>Title</b>", 'a "caption"', "pixels", b"scale")
    parts = [
        html.section("A & B", html.text("1 < 2"), html.row([picture, picture])),
        html.table(["name", "value"], [["error `depth_median_pct`", "<1 %"]], numbers=[1]),
        html.bars([("one", 2.0, "2 s"), ("none", 0.0, "0 s")]),
        html.facts([("3 %", "less & less")]),
    ]
    reader = Reader()
    reader.feed(html.page("T", parts))
    assert reader.open == []
    assert len(reader.sources) == 4
    assert all(source.startswith("data:image/png;base64,") for source in reader.sources)
    words = "".join(reader.words)
    assert all(part in words for part in ("A & B", "1 < 2", "<b>Title</b>", "<1 %", "less & less", "depth_median_pct"))


def test_display_is_the_srgb_curve() -> None:
    assert style.display(np.array([0.0, 0.0031308, 0.2140, 1.0, 7.0])) == pytest.approx(
        [0.0, 0.04045, 0.5, 1.0, 1.0], abs=2e-4
    )
    assert style.exposure_for(np.linspace(0, 2, 10_001), 99) == pytest.approx(1 / 1.98, rel=1e-3)


def test_unknown_pixels_are_transparent() -> None:
    colours = style.mapped(np.array([[0.0, 1.0, np.nan]]), 0.0, 1.0, "gray")
    assert colours[0].tolist() == [[0, 0, 0, 1], [1, 1, 1, 1], [0, 0, 0, 0]]
    decades = style.mapped(np.array([[0.01, 0.1, 1.0]]), 0.01, 1.0, "gray", logarithmic=True)[0, :, 0]
    assert decades == pytest.approx([0, 0.5, 1], abs=0.005)
    normal = figures.normal_colours(np.array([[[0.0, 0.0, 1.0], [np.nan] * 3]]))
    assert normal[0].tolist() == [[0.5, 0.5, 1, 1], [0, 0, 0, 0]]


def test_a_picture_comes_back_from_its_png() -> None:
    values = np.random.default_rng(0).uniform(size=(4, 6, 3))
    np.testing.assert_allclose(pixels(style.picture_png(values))[..., :3], values, atol=0.5 / 255 + 1e-6)


def test_plots_show_something() -> None:
    trials = [Trial(str(i), {}, float(i), {"depth_median_pct": 1.0 / i, "recovered_pct": 100.0}) for i in (1, 2, 40)]
    mesh = relief(synthetic.ball(synthetic.camera(24)))
    drawn = [
        figures.tradeoff_plot(trials, "seconds to solve"),
        figures.tradeoff_plot([Trial("exact", {}, 1.0, {"relight_rel_rmse": 0.0})], "seconds to render"),
        figures.scale_bar(1e-3, 1.0, style.ERROR, "%", logarithmic=True),
        figures.word_scale(style.CONFIDENCE, "low", "high"),
        figures.direction_key(),
        figures.heat(np.geomspace(1e-3, 1, 64).reshape(8, 8), "error"),
        figures.heat(np.zeros((4, 4)), "nothing wrong"),
        *figures.wireframe(mesh, synthetic.camera(24), (0.0, 40.0)),
    ]
    for png in drawn:
        assert np.ptp(pixels(png)[..., 3]) > 0 or np.ptp(pixels(png)[..., 0]) > 0.1


def test_lengths_and_ranks() -> None:
    assert [length(x) for x in (2.4, 0.0035, 4e-6)] == ["2.4 m", "3.5 mm", "0.004 mm"]
    mask = np.array([[True, True, False, True]])
    assert ranks(np.array([[5.0, 1.0, 9.0, 7.0]]), mask).tolist() == [[0.5, 0, 0, 1]]
