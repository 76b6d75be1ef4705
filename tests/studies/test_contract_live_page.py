"""The page that computes: its numbers in a real browser are those of the family and of the material, and of full solves."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from shell.family import Axis
from shell.modes import solve_modes
from studies.cli import main
from studies.instrument.card import load_card
from studies.loss.model import loss_model
from studies.reports import live
from studies.reports.live import COLDEST, TOLERANCE, Designs, describe_live
from studies.reports.live_fields import explore_fields
from studies.reports.scenes import moving_mode
from studies.resonator.law import law_of
from studies.resonator.splitting import SplitPair
from studies.results import Chapter, Sentence
from studies.results.page import render_page
from tests.studies.test_contract_browser import BROWSER, SOFTWARE_GL, browse

WHOLE = pytest.mark.usefixtures("drawn")  # with the sliders of all dimensions
DESIGNS = [(0.9, 15.0, 20.0), (0.87, 15.6, -30.0), (0.94, 14.4, 75.0), (0.8551, 14.26, 33.3)]

ASK = """
<script>
addEventListener("error", event => { document.title = JSON.stringify({error: event.message}); });
addEventListener("load", () => {
  const root = document.querySelector(".live-numbers"), seen = {};
  seen.answers = DESIGNS.map(([h, R, T]) => root.evaluate([h, R], T + 273.15));
  seen.measured = DESIGNS.map(([h, R, T]) => root.measure([h, R], T + 273.15));
  seen.mounted = document.querySelectorAll(".live-numbers")[1].evaluate([14.6], 330)[0];
  seen.drawn = DESIGNS.map(([h, R]) => [...root.draw([h, R])]);
  const canvas = document.querySelector("canvas"), look = () => { document.querySelector(".amplitude").dispatchEvent(new Event("input")); return canvas.toDataURL("image/png"); }, option = () => document.querySelector(".mode option").text;
  const text = () => [...root.querySelectorAll("dd")].map(one => one.textContent);
  const pause = document.querySelector(".pause"); if (pause.textContent === "Pause") pause.click();
  seen.before = [...text(), option()]; seen.pictures = [look()];
  const slider = root.querySelector("input"); slider.value = slider.max; slider.dispatchEvent(new Event("input"));
  setTimeout(() => {
  seen.moved = [...text(), option()]; seen.pictures.push(look()); root.querySelector("button").click(); seen.back = [...text(), option()];
  seen.pictures.push(look()); seen.pictures = seen.pictures.map(one => seen.pictures.indexOf(one));
  seen.requests = performance.getEntriesByType("resource").filter(entry => !entry.name.startsWith("data:")).map(entry => entry.name);
  document.title = JSON.stringify(seen); }, 500);
});
</script>
"""


@pytest.mark.slow
@WHOLE
def test_the_data_are_small_and_bounded():
    data, missing = describe_live(load_card("free-dome"), 2, "shell")
    assert len(json.dumps(data)) - len(data["fields"]["outline"]) < 300_000
    assert " ".join(missing).strip() == "Not in 1/Q: gas (see hrg loss)."
    assert [axis["key"] for axis in data["axes"]] == ["resonator.thickness_mm", "resonator.radius_mm"]
    assert data["modes"][0]["error"] <= TOLERANCE
    assert all(error < 2e-3 for error in data["fields"]["errors"].values())
    assert [(mode["harmonic"], mode["index"]) for mode in data["modes"]] == [(2, 0), (3, 0)]
    assert data["temperature"]["low"] == pytest.approx(COLDEST + 273.15)


@WHOLE
@pytest.mark.slow
def test_a_neighbour_whose_solves_jump_between_layouts_has_sliders_too(monkeypatch):
    """The harmonics 0, 1 and 3 of this card had none: 3.4e-5 was reached, of which 3e-5 were the solver's own steps."""
    none = SimpleNamespace(polynomial=SimpleNamespace(indices=()), missing=(), spell=dict)
    monkeypatch.setattr("studies.reports.live.explore_fields", lambda *_: none)
    data, _ = describe_live(load_card("hrg-30mm"), 0, "solid")
    assert [(mode["harmonic"], mode["index"]) for mode in data["modes"]] == [(0, 0), (1, 0)]
    assert data["modes"][0]["error"] <= TOLERANCE
    radius = data["axes"][1]
    assert (radius["low"], radius["high"]) == pytest.approx((14.25, 15.75))


@pytest.mark.slow
def test_a_material_at_one_temperature_gets_no_slider_of_temperature():
    own = {"name": "own", "youngs_modulus_GPa": 70.0, "poisson_ratio": 0.2, "density_kg_m3": 2500.0}
    data, missing = describe_live(load_card("free-dome").with_table("material", own), 2, "shell")
    assert "There is no Q" in " ".join(missing)
    assert data["temperature"]["low"] == data["temperature"]["high"]
    assert not data["slope"]


@WHOLE
@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this machine")
def test_the_browser_computes_what_python_computes(tmp_path, monkeypatch):
    held = load_card("free-dome").with_values({"resonator.support": "clamped-rim"})
    held = held.with_table("mount", {"expansion_per_K": 5.1e-6})
    mounted = live.live_blocks(held, names=["resonator.radius_mm"])
    made = {}

    def keep(name, whole):
        monkeypatch.setattr(live, name, lambda *given: made.setdefault(name, whole(*given)))

    for name in ("describe_live", "explore_fields", "_families"):  # what the page carries
        keep(name, getattr(live, name))
    card = load_card("free-dome")
    text = render_page("Live", "lead", [Chapter("Numbers", [*moving_mode(card), *mounted])])
    page = tmp_path / "page.html"
    page.write_text(text.replace("</body>", ASK.replace("DESIGNS", json.dumps(DESIGNS)) + "</body>"))
    seen = browse(page, *SOFTWARE_GL)
    assert "error" not in seen, seen
    assert seen["requests"] == []
    assert seen["before"] == seen["back"]
    assert all(one != other for one, other in zip(seen["before"], seen["moved"], strict=True) if "surface" not in one)
    assert seen["pictures"] == [0, 1, 0]
    assert float(seen["before"][0].removesuffix(" Hz")) == pytest.approx(4599.68, abs=0.2)

    from studies.sweeps.parameters import set_parameters

    law = law_of(set_parameters(held, {"resonator.radius_mm": 14.6}))  # the stress of the base: 170 ppm of f, 5 ppm/K
    assert seen["mounted"]["frequency"] == pytest.approx(float(law.frequency(330.0)), rel=TOLERANCE)
    assert seen["mounted"]["slope"] == pytest.approx(float(law.slope(330.0)), abs=2e-8)

    (data, _), fields, ((family, *_), _) = made["describe_live"], made["explore_fields"], made["_families"]
    names = [axis["key"] for axis in data["axes"]]
    designs = Designs(card, tuple(Axis(axis["key"], axis["low"], axis["high"]) for axis in data["axes"]), ())
    material = card.material
    for (h, R, T), (own, other), measured, drawn in zip(
        DESIGNS, *(seen[key] for key in ("answers", "measured", "drawn")), strict=True
    ):
        K = T + 273.15
        python = evaluate(fields, data, [h, R], K)
        assert dict(measured["parts"]) == pytest.approx(python["parts"], rel=1e-6)
        assert measured["wave"] == pytest.approx(python["wave"], rel=1e-6)
        assert np.array(drawn) == pytest.approx(python["outline"], abs=1e-6 * abs(python["outline"]).max())
        budget = loss_model(designs.make([h, R])).budget(K)
        assert sum(python["parts"].values()) == pytest.approx(float(budget.inverse_q[0]), rel=fields.errors["loss"])

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
            assert told["frequency"] == pytest.approx(
                solve_modes(*moved, n)[0].frequency, rel=TOLERANCE if n == 2 else 1e-3
            )


def evaluate(fields, data, values, T):
    """What the page tells, from the interpolant: parts of 1/Q, wave (re, im), outline."""
    unit = [
        (2 * v - axis["low"] - axis["high"]) / (axis["high"] - axis["low"])
        for v, axis in zip(values, data["axes"], strict=True)
    ]
    heat = data["temperature"]
    x = (2 * T - heat["low"] - heat["high"]) / (heat["high"] - heat["low"])
    found = fields.polynomial(np.array([unit]))[0]
    loss, wave, outline = np.split(found, np.cumsum(list(fields.blocks.values()))[:-1])
    parts = np.exp([np.polynomial.chebyshev.chebval(x, c) for c in np.split(loss, len(fields.losses))])
    return {
        "parts": dict(zip(fields.losses, parts, strict=True)),
        "wave": [np.polynomial.chebyshev.chebval(x, c) for c in np.split(wave, 2)],
        "outline": outline,
    }


@WHOLE
@pytest.mark.slow
def test_the_split_of_an_imperfect_shell_moves_as_full_solves_say():
    wave = [
        {"of": "wall", "order": 4, "amplitude_um": 0.5, "azimuth_deg": 20.0},
        {"of": "inner", "order": 4, "amplitude_um": 0.3},
    ]
    card = load_card("free-dome").with_table("imperfection", {"wave": wave})
    data, _ = describe_live(card, 2, "shell")
    designs = Designs(card, tuple(Axis(axis["key"], axis["low"], axis["high"]) for axis in data["axes"]), ())
    T = data["temperature"]["low"], data["temperature"]["high"]
    fields = explore_fields(designs.at_point, 2, 2, "shell", T, card)
    assert not fields.per_micrometre
    for h, R, t in DESIGNS:
        moved = designs.make([h, R])
        full = SplitPair(moved, solve_modes(*moved.at(t + 273.15), 2, theory="shell")[0], t + 273.15).split.wave
        assert complex(*evaluate(fields, data, [h, R], t + 273.15)["wave"]) == pytest.approx(
            full, rel=max(fields.errors["wave"], 1e-4)
        )


def test_the_page_of_tcf_has_the_sliders_but_for_the_closed_form(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(live, "live_blocks", lambda card, *_: [Sentence(f"sliders of {card.name}")])
    assert main(["tcf", "hrg-30mm", "--theory", "shell", "--report", "tcf.html"]) == 0
    text = (tmp_path / "tcf.html").read_text(encoding="utf-8")
    assert text.count("sliders of hrg-30mm") == 1
    # of what its numbers are
    assert text.count("Measured on the gyro of the HRG paper (Sensors 2012, 12, 6434, Table 1).") == 1
    assert main(["tcf", "free-dome", "--theory", "rayleigh", "--report", "rayleigh.html"]) == 0
    assert "sliders of" not in (tmp_path / "rayleigh.html").read_text(encoding="utf-8")
