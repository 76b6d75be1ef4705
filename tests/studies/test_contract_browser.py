"""The interactive mode view in a real headless browser, with the network cut where the system permits it."""

import base64
import html
import io
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from shell.modes import solve_modes
from studies.instrument.card import load_card
from studies.reports import style
from studies.reports.webgl import view_modes
from studies.results import Chapter, Sentence
from studies.results.page import Cells, draw, render_page

BROWSER = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome", "chrome") if (found := shutil.which(name))),
    None,
)
pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this machine")]
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]

# What a person does, done by a script inside the page; its findings end up in the title.
VISIT = """
<script>
addEventListener("error", event => { document.title = JSON.stringify({error: event.message}); });
const wait = seconds => new Promise(done => setTimeout(done, 1000 * seconds));
async function visit() {
  const root = document.querySelector(".mode-view"), find = name => root.querySelector(name), seen = {};
  const canvas = find("canvas"), look = () => canvas.toDataURL("image/png");
  const redraw = () => find(".amplitude").dispatchEvent(new Event("input"));
  seen.live = !find(".live").hidden; seen.still = !find(".still").hidden; seen.state = root.dataset.state;
  seen.requests = performance.getEntriesByType("resource").filter(entry => !entry.name.startsWith("data:")).map(entry => entry.name);
  if (!seen.live) { document.title = JSON.stringify({...seen, reason: find(".reason").textContent}); return; }
  if (root.dataset.state === "paused") find(".pause").click();
  const before = +root.dataset.frames;
  for (let k = 0; k < 100 && root.dataset.frames - before < 3; k++) await new Promise(requestAnimationFrame);  // by frames: virtual time runs ahead of a slow machine
  seen.swings = root.dataset.frames - before;
  find(".pause").click(); await wait(0.2);
  const stopped = root.dataset.frames; await wait(0.4); seen.pauses = root.dataset.frames === stopped; seen.label = find(".pause").textContent;
  redraw(); seen.large = look();
  find(".amplitude").value = 0; redraw(); seen.flat = look();
  find(".amplitude").value = 0.2; redraw(); seen.larger = look();
  canvas.dispatchEvent(new KeyboardEvent("keydown", {key: "ArrowLeft"})); seen.turned = look();
  seen.modes = [...find(".mode").options].map(option => option.text);
  find(".mode").value = 1; find(".mode").dispatchEvent(new Event("change")); seen.other = look();
  find(".colour").value = 1; find(".colour").dispatchEvent(new Event("change")); seen.energy = look(); seen.legend = find(".top").textContent;
  const curves = document.querySelector("figure.curves canvas"), told = () => document.querySelector(".reading").textContent;
  const go = (kind, x) => { const at = curves.getBoundingClientRect();
    curves.dispatchEvent(new PointerEvent(kind, {clientX: at.left + x * at.width, clientY: at.top + at.height / 2})); };
  go("pointermove", 0.5); seen.whole = told();
  go("pointerdown", 0.4); go("pointermove", 0.6); go("pointerup", 0.6); go("pointermove", 0.5); seen.part = told();
  seen.button = !document.querySelector(".curves button").hidden;
  document.querySelector(".curves button").click(); go("pointermove", 0.5); seen.again = told();
  const table = document.querySelector("table"); seen.table = table.scrollWidth; seen.room = table.parentElement.clientWidth;
  document.title = JSON.stringify(seen);
}
addEventListener("load", () => visit().catch(error => { document.title = JSON.stringify({error: String(error)}); }));
</script>
"""


def browse(page, *flags, time="10000"):
    """Load a page without a network and return what its title holds when time is up; a loaded machine has more of it."""
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", "--disable-quic", f"--user-data-dir={page.parent / 'profile'}",
        "--window-size=1280,900", f"--virtual-time-budget={time}", *flags, "--dump-dom", f"file://{page}",
    ]  # fmt: skip
    cut = shutil.which("unshare") and subprocess.run(["unshare", "-n", "true"], capture_output=True).returncode == 0
    done = subprocess.run(["unshare", "-n", *command] if cut else command, capture_output=True, text=True, timeout=600)
    title = re.search(r"<title>(.*?)</title>", done.stdout, re.DOTALL)
    assert title, done.stderr[-2000:]
    if not title.group(1).startswith("{") and len(time) == 5:
        return browse(page, *flags, time="100000")
    return json.loads(html.unescape(title.group(1)))


def picture(uri):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))).convert("RGB")).astype(int)


def difference(one, two):
    return float(abs(picture(one) - picture(two)).mean())


HEAD = ["quantity", "unit", "card", "calibrated", "90 % interval", "shift (sd)", "width", "determined by",
        "key of the card"]  # fmt: skip
NUMBERS = "1.0000e-7|1.00000e-7|9.9966e-8 … 1.00052e-7|+0.00|0.000|data and prior"
CURVATURE = "temperature curvature of the shear modulus|1/K²", "material.deviation.shear_modulus.log_curvature_per_K2"
LOSS = "1/Q at the reference temperature|J/(kg K)", "loss.inverse_q_at_reference"
ROWS = [f"{named}|{NUMBERS}|{key}".split("|") for named, key in (LOSS, CURVATURE)]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A mode view, a figure and a table on one page."""
    instrument = load_card("free-dome")
    elastic = instrument.material.elastic(instrument.reference_temperature)
    modes = [solve_modes(instrument.resonator, elastic, n, theory="shell", tolerance=1e-3)[0] for n in (2, 3)]
    buffer = io.BytesIO()
    Image.new("RGB", (8, 8), "gray").save(buffer, "PNG")
    view = view_modes(instrument.resonator, modes, "free-dome", buffer.getvalue(), "a dome with four lobes", "caption")
    x = np.linspace(-1.0, 1.0, 2001)
    with style.figure(x="time (h)", y="bias (°/h)") as (made, axes):
        axes.plot(x, 3.0 + x**3, label="<b>")
    parts = [Sentence("before"), view, draw(made, "caption", "alt"), Cells("Values", HEAD, ROWS, sortable=True)]
    text = render_page("Modes", "lead", [Chapter("Mode shapes", parts)])
    path = tmp_path_factory.mktemp("browser") / "page.html"
    path.write_text(text.replace("</body>", VISIT + "</body>"))
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?!data:)(?:https?:)?//""", text)
    return path


@pytest.fixture(scope="module")
def seen(page):
    return browse(page, *SOFTWARE_GL)


def test_the_page_is_live_and_asks_the_network_for_nothing(seen):
    assert "error" not in seen, seen
    assert (seen["live"], seen["still"], seen["requests"]) == (True, False, [])


def test_a_figure_shows_values_under_the_pointer_and_a_part_of_it_enlarged(seen):
    assert seen["button"]
    for said in (seen["whole"], seen["part"], seen["again"]):
        found = re.fullmatch(r"time \(h\) (−?[\d.]+) · <b> ([\d.]+) °/h", said)
        at, value = (float(number.replace("−", "-")) for number in found.groups())
        assert value == pytest.approx(3.0 + at**3, abs=2e-3)
    assert seen["whole"] == seen["again"]


def test_nine_columns_with_a_key_of_the_card_fit_a_screen_of_1280_px(seen):
    """The last column of a calibration, the key of the card, was cut off."""
    assert seen["table"] <= seen["room"] <= 1280


def test_the_mode_swings_pauses_and_turns(seen):
    assert seen["swings"] >= 3  # frames drawn by itself
    assert seen["pauses"]
    assert seen["label"] == "Swing"
    assert difference(seen["larger"], seen["turned"]) > 0.3
    assert difference(seen["flat"], seen["larger"]) > 0.3


def test_the_harmonic_and_the_colour_are_chosen(seen):
    assert [label.split(":")[0] for label in seen["modes"]] == ["n = 2", "n = 3"]
    assert all(label.endswith("Hz") for label in seen["modes"])
    assert difference(seen["turned"], seen["other"]) > 0.3
    assert difference(seen["other"], seen["energy"]) > 0.3
    assert "J/m³" in seen["legend"]


def test_the_resonator_stands_in_the_middle_of_its_canvas(seen):
    flat = picture(seen["flat"])
    rows, columns = np.nonzero(flat.min(axis=-1) < 225)
    height, width = flat.shape[:2]
    assert len(rows) > 0.15 * height * width
    assert abs((columns.min() + columns.max()) / 2 - width / 2) < 0.03 * width
    assert rows.min() > 2
    assert rows.max() < height - 3


def test_without_webgl_the_picture_stays(page):
    found = browse(page, "--disable-3d-apis")
    assert "error" not in found, found
    assert (found["live"], found["still"]) == (False, True)
    assert "no WebGL2" in found["reason"]
