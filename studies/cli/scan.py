"""`hrg scan`: wall maps, circumferential harmonics and frequency splits from measured faces of a shell."""

from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from cyclopts import Parameter

from shell.constants import zero_Celsius
from shell.resonator import FaceName
from studies.cli.arguments import COUNT, MANY, Card, Temperature, Theory, open_resonator
from studies.cli.output import answers, say
from studies.errors import InputError
from studies.files.paths import beside
from studies.files.writing import write_csv
from studies.instrument.card import Instrument, save_card
from studies.reports.digits import plain, to_interval
from studies.reports.style import BLUE, ORANGE, figure
from studies.resonator.scan import Scan, scan_faces
from studies.results import Chapter, Drawing, Fact, Facts, Figure, Result, Sentence, Table, row_of

NONE = "none"
TABLE = "-{}.csv"  # of a face, beside the saved card


SPLITS = (
    "harmonic: n | frequency_Hz: frequency (Hz) .3f | split_Hz.value: split (mHz) ×1e3 | split_Hz.low … split_Hz.high: 90 % interval (mHz) ×1e3"
    " | slow_axis_deg.value: slow axis (°) .2f | slow_axis_deg.low … slow_axis_deg.high: 90 % interval (°) .2f"
    " | every_order.split_Hz: split, all orders (mHz) ×1e3 | every_order.slow_axis_deg: slow axis, all orders (°) .2f"
)
NAMES = {"wall": "wall", "offset": "middle surface", "inner": "inner face", "outer": "outer face"}
HARMONICS = "order: harmonic | amplitude_um.value: amplitude (µm) .3f | amplitude_um.low … amplitude_um.high: 90 % interval (µm) .3f | crest: azimuth of a crest (°) .1f"
FACES = (
    "face | file | points | outliers | noise_um: noise (nm) ×1e3 .1f | position.0 … position.1: positions .3f"
    " | offset_um.0: offset x (µm) .1f | offset_um.1: offset y (µm) .1f | offset_um.2: offset z (µm) .1f | tilt_deg: tilt (°) .3f"
)
ROUNDNESS = "face | position: position .3f | peak_to_valley_um: peak to valley (µm) .3f | rms_um: rms (µm) .3f"


@answers("hrg.scan/1", save=tuple(TABLE.format(face) for face in get_args(FaceName)))
def scan(
    card: Card,
    inner: str,
    outer: str = NONE,
    *,
    unit: Literal["mm", "um", "m"] = "mm",
    frames: Literal["own", "common"] = "own",
    harmonic: Annotated[tuple[int, ...], MANY, COUNT] = (1, 2, 3, 4),
    highest: int = 12,
    temperature: Temperature = None,
    theory: Theory = "solid",
    map_file: Annotated[str | None, Parameter(name="--map")] = None,
    save: str | None = None,
) -> Result:
    """Compute wall maps, circumferential harmonics and frequency splits, with intervals, from measured faces of a shell.

    Points are x y z text (comments after #), .ply, .stl or .obj; or a table over position and azimuth: first line
    "position,0,5,10,…" with azimuths in degrees, then a line per position (0 ... 1 along the meridian) with the deviation of
    the face in µm, positive away from the material. Faces are aligned with the card's resonator; gaps and outliers are
    allowed. Eccentricity of the two spheres is part of the wall only if both share one frame (--frames common).

    Args:
        inner: Points of the inner face; none if only the outer face was measured.
        outer: Points of the outer face; none if only the inner face was measured.
        unit: Unit of the points.
        frames: own: each face has its own coordinate frame. common: both share one frame, and eccentricity counts.
        harmonic: Harmonics n of the splits.
        highest: Highest circumferential harmonic of the fit, at least twice the highest n.
        map_file: Write a CSV file: position, azimuth, and deviations of faces, wall and middle surface.
        save: Write a card with the fitted faces as its imperfection; the tables are written beside it.
    """
    files = {name: path for name, path in zip(get_args(FaceName), (inner, outer), strict=True) if path != NONE}
    if not files:
        raise InputError("no face given: name the file of the inner face, of the outer face, or of both.")
    instrument, T, resonator, elastic = open_resonator(card, temperature)
    found = scan_faces(
        resonator, elastic, files, unit=unit, frames=frames, harmonics=harmonic, highest=highest, theory=theory, say=say
    )  # fmt: skip
    if map_file is not None:
        _write_maps(map_file, found)
        say(f"wrote {map_file}")
    if save is not None:
        _save(save, instrument, found)
        say(f"wrote {save}")
    payload = _payload(found, instrument.name, T - zero_Celsius, files)
    return Result(
        payload,
        f"Scan of {instrument.name}",
        "Measured faces, aligned with the card's resonator and fitted with circumferential harmonics, and the resulting frequency splits.",
        _parts(found, payload),
    )


def _parts(found: Scan, payload: dict[str, Any]) -> list[Chapter]:
    faces, splits = payload["faces"], payload["splits"]
    shown = ("wall", "offset") if len(faces) == 2 else tuple(faces)
    rim = max(w.position for w in found.waves)
    waves: dict[str, list[dict[str, Any]]] = {}
    for w in payload["waves"]:
        if w["quantity"] in shown and w["position"] == rim:
            waves.setdefault(w["quantity"], []).append(w | {"crest": w["azimuth_deg"] if w["order"] else None})
    note = "First order: from harmonic 2n alone. All orders: with products of harmonics. Slow axis: an antinode of the slower mode."
    if any(one["slow_axis_deg"] is None for one in splits):
        note += " <: 95 % limit of a split that is not significant and has no axis."
    only = Sentence("Only one face was measured; the other is assumed perfect.", "warning") if len(faces) == 1 else None
    return [
        Chapter("Summary", [Facts(_facts(payload), "page"), only,
            Table("Frequency splits from the measured faces", list(map(_significant, splits)), SPLITS, note)]),
        Chapter("Maps", [Figure(lambda: _draw_maps(found), "Fitted deviations over azimuth and meridian.")]),
        Chapter("Circumferential harmonics", [
            Figure(lambda: _draw_harmonics(found), "Amplitudes at the rim with 90 % intervals; harmonic 2n splits the modes n."),
            *(Table(f"Circumferential harmonics of the {name} at position {rim:.3f}", waves[key], HARMONICS) for key, name in NAMES.items() if key in waves),
        ]),
        Chapter("Roundness", [Table("Roundness of circles", payload["roundness"], ROUNDNESS,
            "From harmonic 2 upwards; harmonic 1 is the eccentricity of the circle.", "page")]),
        Chapter("Faces", [Table("Faces as read", [{"face": name} | face for name, face in faces.items()], FACES)]),
    ]  # fmt: skip


def _significant(split: dict[str, Any]) -> dict[str, Any]:
    if split["slow_axis_deg"] is not None:
        return split
    limit = f"< {plain(1e3 * split['split_Hz']['high'])}"
    return split | {"split_Hz": {"value": limit, "low": None, "high": None}, "every_order": {}}


def _facts(payload: dict[str, Any]) -> list[Fact]:
    main = min(payload["splits"], key=lambda one: abs(one["harmonic"] - 2))
    split, low, high = to_interval(*(1e3 * main["split_Hz"][key] for key in ("value", "low", "high")))
    axis, noise = main["slow_axis_deg"], [1e3 * face["noise_um"] for face in payload["faces"].values()]
    return [
        (f"Split of n = {main['harmonic']}", f"{split} mHz", f"90 %: {low} … {high} mHz"),
        ("Slow axis", f"{axis['value']:.1f}°" if axis else "undetermined", "antinode of the slower mode: remove mass there" if axis else ""),
        ("Noise per point", ", ".join(f"{one:.0f} nm" for one in noise), " and ".join(payload["faces"])),
    ]  # fmt: skip


def _payload(found: Scan, name: str, temperature: float, files: dict[str, str]) -> dict[str, Any]:
    degrees = float(np.rad2deg(1.0))
    faces = {
        side: {"file": files[side], "position": [face.waves.low, face.waves.high]}
        | row_of(face, "points", "outliers", noise_um=("noise", 1e6))
        | row_of(face.motion, offset_um=("offset", 1e6), tilt_deg=("tilt", degrees), told="told")
        for side, face in found.faces.items()
    }
    splits = [
        row_of(one, harmonic="split.harmonic", frequency_Hz="split.frequency", split_Hz="hertz", relative_ppm=("relative", 1e6),
            slow_axis_deg=("slow_axis", degrees), shift_ppm=("split.shift", 1e6))
        | {"every_order": row_of(one.whole, split_Hz="hertz", slow_axis_deg=("slow_axis", degrees), shift_ppm=("shift", 1e6))}
        for one in found.splits
    ]  # fmt: skip
    wave = {"azimuth_deg": ("azimuth", degrees), "amplitude_um": ("amplitude", 1e6)}
    circle = {"peak_to_valley_um": ("peak_to_valley", 1e6), "rms_um": ("rms", 1e6)}
    return {
        "card": name,
        "temperature_degC": temperature,
        "faces": faces,
        "splits": splits,
        "waves": [row_of(w, "quantity", "order", "position", **wave) for w in found.waves],
        "roundness": [row_of(r, "face", "position", **circle) for r in found.roundness],
    }


def _save(path: str, instrument: Instrument, found: Scan) -> None:
    target, maps = Path(path).resolve(), []
    for name in found.faces:
        x, theta, values = found.map_of(name, columns=72)
        own = beside(target, TABLE.format(name))
        rows = ([f"{at:.9g}", *(f"{1e6 * cell:.7g}" for cell in row)] for at, row in zip(x, values, strict=True))
        write_csv(own, ["position", *(f"{angle:g}" for angle in np.rad2deg(theta))], rows)
        maps.append({"of": name, "file": str(own)})
    table = {**instrument.content.get("imperfection", {}), "map": maps}
    save_card(instrument.with_table("imperfection", table), path)


def _write_maps(path: str, found: Scan) -> None:
    names = [*found.faces, *(("wall", "offset") if len(found.faces) == 2 else ())]
    maps = {name: found.map_of(name) for name in names}
    x, theta, _ = next(iter(maps.values()))
    rows = (
        [f"{at:.6f}", f"{np.rad2deg(angle):.3f}", *(f"{1e6 * values[i, j]:.5f}" for _, _, values in maps.values())]
        for i, at in enumerate(x)
        for j, angle in enumerate(theta)
    )
    write_csv(path, ["position", "azimuth_deg", *(f"{name}_um" for name in names)], rows)


def _draw_maps(scan: Scan) -> Drawing:
    names = ["wall", "offset"] if len(scan.faces) == 2 else list(scan.faces)
    with figure(len(names), 1, 2.5 * len(names), squeeze=False) as (made, axes):
        for ax, name in zip(axes[:, 0], names, strict=True):
            x, theta, values = scan.map_of(name)
            shown = 1e6 * (values - values.mean(axis=1, keepdims=True))
            most = max(float(abs(shown).max()), 1e-6)
            look = {"cmap": "RdBu_r", "vmin": -most, "vmax": most, "shading": "nearest", "rasterized": True}
            image = ax.pcolormesh(np.rad2deg(theta), x, shown, **look)
            made.colorbar(image, ax=ax, label="µm")
            ax.set(title={"wall": "wall thickness, mean of each circle removed", "offset": "middle surface"}.get(name, f"{name} face"),
                   xlabel="azimuth (°)", ylabel="position (1: rim)", xticks=range(0, 361, 45))  # fmt: skip
            ax.grid(False)
        return made


def _draw_harmonics(scan: Scan) -> Drawing:
    quantity = "wall" if len(scan.faces) == 2 else next(iter(scan.faces))
    rim = max(w.position for w in scan.waves)
    with figure(1, 1, 3.2) as (made, ax):
        for q, colour, shift in ((quantity, BLUE, -0.15), ("offset", ORANGE, 0.15)):
            mine = [w for w in scan.waves if w.quantity == q and w.position == rim and w.order > 0]
            if not mine:
                continue
            order, value, low, high = np.array([
                (w.order, *(1e6 * getattr(w.amplitude, key) for key in ("value", "low", "high"))) for w in mine
            ]).T  # fmt: skip
            ax.bar(order + shift, value, 0.28, color=colour, label="middle surface" if q == "offset" else q)
            reach = np.maximum([value - low, high - value], 0)
            ax.errorbar(order + shift, value, reach, fmt="none", ecolor="black", capsize=2)
        ax.set(xlabel="circumferential harmonic", ylabel="amplitude at the rim (µm)", yscale="log")
        return made
