"""The page that computes: its numbers in a real browser are those of the family and of the material, and of full solves."""

import json

import numpy as np
import pytest

from shell.family import Axis, build_family
from shell.modes import solve_modes
from studies.cli import main
from studies.instrument.card import load_card
from studies.reports.live import COLDEST, TOLERANCE, describe_family, live_blocks
from studies.results import Chapter
from studies.results.page import render_page
from tests.studies.test_contract_browser import BROWSER, browse

DESIGNS = [(0.9, 15.0, 20.0), (0.87, 15.6, -30.0), (0.94, 14.4, 75.0), (0.8551, 14.26, 33.3)]

ASK = """
<script>
addEventListener("error", event => { document.title = JSON.stringify({error: event.message}); });
addEventListener("load", () => {
  const root = document.querySelector(".live-numbers"), seen = {};
  seen.answers = DESIGNS.map(([h, R, T]) => root.evaluate([h, R], T + 273.15));
  const text = () => [...root.querySelectorAll("dd")].map(one => one.textContent);
  seen.before = text();
  const slider = root.querySelector("input"); slider.value = slider.max; slider.dispatchEvent(new Event("input"));
  seen.moved = text(); root.querySelector("button").click(); seen.back = text();
  seen.requests = performance.getEntriesByType("resource").filter(entry => !entry.name.startsWith("data:")).map(entry => entry.name);
  document.title = JSON.stringify(seen);
});
</script>
"""


def test_the_data_are_small_and_bounded():
    data = describe_family(load_card("free-dome"), 2, "shell")
    assert len(json.dumps(data)) < 300_000
    assert [axis["key"] for axis in data["axes"]] == ["resonator.thickness_mm", "resonator.radius_mm"]
    assert all(mode["error"] <= TOLERANCE for mode in data["modes"])
    assert [(mode["harmonic"], mode["index"]) for mode in data["modes"]] == [(2, 0), (3, 0)]
    assert data["temperature"]["low"] == pytest.approx(COLDEST + 273.15)


@pytest.mark.slow
def test_a_neighbour_whose_solves_jump_between_layouts_has_sliders_too():
    """The harmonics 0, 1 and 3 of this card had none: 3.4e-5 was reached, of which 3e-5 were the solver's own steps."""
    data = describe_family(load_card("hrg-30mm"), 0, "solid")
    assert [(mode["harmonic"], mode["index"]) for mode in data["modes"]] == [(0, 0), (1, 0)]
    assert all(mode["error"] <= TOLERANCE for mode in data["modes"])
    radius = data["axes"][1]
    assert (radius["low"], radius["high"]) == pytest.approx((14.25, 15.75))


def test_a_material_at_one_temperature_gets_no_slider_of_temperature():
    own = {"name": "own", "youngs_modulus_GPa": 70.0, "poisson_ratio": 0.2, "density_kg_m3": 2500.0}
    data = describe_family(load_card("free-dome").with_table("material", own), 2, "shell")
    assert data["temperature"]["low"] == data["temperature"]["high"]
    assert not data["slope"]


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this machine")
def test_the_browser_computes_what_python_computes(tmp_path):
    card = load_card("free-dome")
    data = describe_family(card, 2, "solid")
    text = render_page("Live", "lead", [Chapter("Numbers", live_blocks(card))])
    page = tmp_path / "page.html"
    page.write_text(text.replace("</body>", ASK.replace("DESIGNS", json.dumps(DESIGNS)) + "</body>"))
    seen = browse(page)
    assert "error" not in seen, seen
    assert seen["requests"] == []
    assert seen["before"] == seen["back"] != seen["moved"]
    assert float(seen["before"][0].removesuffix(" Hz")) == pytest.approx(4599.68, abs=0.2)

    from studies.sweeps.parameters import set_parameters

    axes = [Axis(axis["key"], axis["low"], axis["high"]) for axis in data["axes"]]
    names = [axis.name for axis in axes]
    family = build_family(
        lambda v: set_parameters(card, dict(zip(names, v.tolist(), strict=True))).resonator,
        axes,
        nu=data["nu"],
        tolerance=TOLERANCE,
    )
    material = card.material
    for (h, R, T), (own, other) in zip(DESIGNS, seen["answers"], strict=True):
        K = T + 273.15

        def f(K, values=(h, R)):
            E, nu, rho = (float(material.value(name, K)) for name in ("youngs_modulus", "poisson_ratio", "density"))
            growth = float(material.growth(K, card.reference_temperature))
            return family.evaluate([values], nu=nu, E=E, rho=rho, growth=growth)

        assert own["frequency"] == pytest.approx(float(f(K).frequency[0]), rel=1e-6)
        assert own["bryan"] == pytest.approx(float(f(K).bryan_factor[0]), abs=1e-6)
        slope = np.log(float(f(K + 0.5).frequency[0]) / float(f(K - 0.5).frequency[0]))
        assert own["slope"] == pytest.approx(slope, abs=2e-9)
        moved = set_parameters(card, dict(zip(names, (h, R), strict=True))).at(K)
        for told, n in ((own, 2), (other, 3)):
            assert told["frequency"] == pytest.approx(solve_modes(*moved, n)[0].frequency, rel=TOLERANCE)


@pytest.mark.slow
def test_the_pages_of_modes_and_tcf_have_the_sliders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["tcf", "free-dome", "--theory", "shell", "--report", "tcf.html"]) == 0
    text = (tmp_path / "tcf.html").read_text(encoding="utf-8")
    assert text.count('class="live-numbers"') == 1
    assert main(["tcf", "free-dome", "--theory", "rayleigh", "--report", "rayleigh.html"]) == 0
    assert "live-numbers" not in (tmp_path / "rayleigh.html").read_text(encoding="utf-8")
