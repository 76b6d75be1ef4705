"""`hrg scan`: measured faces of a shell to wall maps, waves around and frequency splits.

With --json one object, schema `hrg.scan/1`: `card`, `temperature_degC`; `faces` of inner and outer with `file`, `points`, `outliers`,
`noise_um` of one point, `position` covered, `offset_um`, `tilt_deg` of the alignment, `told` (which of x, y, z, tilts the shape tells);
`splits`, one per harmonic, with `split_Hz`, `relative_ppm`, `slow_axis_deg` as {value, low, high} (90 %; the axis null where no split is
told from 0), `shift_ppm`, and `every_order` {split_Hz, slow_axis_deg, shift_ppm} of the coupled harmonics; `waves` of each face, the wall and
the offset {quantity, order, position, amplitude_um {value, low, high}, azimuth_deg}; `roundness` {face, position, peak_to_valley_um, rms_um}.
"""

from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from studies.instrument.card import Instrument
    from studies.scan import Scan, ScanInterval

NONE = "none"


@answers("hrg.scan/1")
def scan(
    card: str,
    inner: str,
    outer: str = NONE,
    *,
    unit: Literal["mm", "um", "m"] = "mm",
    frames: Literal["own", "common"] = "own",
    harmonic: Annotated[tuple[int, ...], Parameter(consume_multiple=True)] = (1, 2, 3, 4),
    highest: int = 12,
    temperature: float | None = None,
    theory: Literal["solid", "shell"] = "solid",
    map_file: Annotated[str | None, Parameter(name="--map")] = None,
    report: str | None = None,
    save: str | None = None,
) -> Answer:
    """Turn measured points of one or both faces into wall and offset maps, circumferential harmonics, and frequency splits with intervals.

    Points are x y z text (comments behind #), .ply or .stl; or a table over position and azimuth: first line
    "position,0,5,10,…" with azimuths in degrees, then a line per position (0 ... 1 of the meridian) with how far the face
    stands out of the material in µm. Each face is brought onto the card's resonator; gaps and outliers are allowed.
    A shift of one sphere against the other is no harmonic of the wall unless both share one frame (--frames common).

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships (hrg cards).
    inner : str
        Points of the inner face; none if only the outer one was measured.
    outer : str
        Points of the outer face; none if only the inner one was measured.
    unit : str
        Unit of the points.
    frames : str
        own: each face was measured in a frame of its own. common: both in one frame, and eccentricity counts.
    harmonic : tuple[int, ...]
        Harmonics n whose splits are wanted.
    highest : int
        Highest circumferential harmonic that is fitted, at least twice the highest n.
    temperature : float
        Temperature in °C; the card's reference temperature unless given.
    theory : str
        solid (three-dimensional) or shell (Naghdi).
    map_file : str
        CSV to write: position, azimuth and the departures of faces, wall and middle surface.
    report : str
        Page to write: unwrapped maps, harmonics, roundness, splits.
    save : str
        Card to write: this one with the fitted faces as its imperfection, in tables beside it.
    """
    from shell.constants import zero_Celsius
    from studies.cli.output import say
    from studies.errors import InputError, naming
    from studies.instrument.card import load_card
    from studies.scan import scan_faces

    files = {name: path for name, path in (("inner", inner), ("outer", outer)) if path != NONE}
    if not files:
        raise InputError("no face is given: name the file of the inner face, of the outer face, or both.")
    if min(harmonic) < 1:
        raise InputError(f"--harmonic {min(harmonic)}: pairs have harmonics from 1 up.")
    instrument = load_card(card)
    T = instrument.reference_temperature if temperature is None else temperature + zero_Celsius
    with naming(instrument.path):
        resonator, elastic = instrument.at(T)
    found = scan_faces(
        resonator, elastic, files, unit=unit, frames=frames, harmonics=harmonic, highest=highest, theory=theory, say=say
    )  # fmt: skip
    if map_file is not None:
        from studies.files.writing import write_text

        write_text(map_file, _map_csv(found))
        say(f"wrote {map_file}")
    if report is not None:
        from studies.reports.scan import write_scan_page

        write_scan_page(report, found, instrument.name, files)
        say(f"wrote {report}")
    if save is not None:
        _save(save, instrument, found)
        say(f"wrote {save}")
    payload = _payload(found, instrument.name, T - zero_Celsius, files)
    yield payload
    _print(found, payload)


def _print(found: "Scan", payload: dict[str, Any]) -> None:
    from math import degrees

    from studies.cli.output import print_table

    faces = payload["faces"]
    splits = [
        [
            str(entry["harmonic"]),
            f"{entry['split_Hz']['value']:.5f}",
            f"{entry['split_Hz']['low']:.5f} … {entry['split_Hz']['high']:.5f}",
            f"{axis['value']:.2f}" if (axis := entry["slow_axis_deg"]) else "not told",
            f"{axis['low']:.2f} … {axis['high']:.2f}" if axis else "",
            f"{entry['every_order']['split_Hz']:.5f}",
            f"{entry['every_order']['slow_axis_deg']:.2f}",
        ]
        for entry in payload["splits"]
    ]
    print_table(
        f"{payload['card']}: splits by the measured {' and '.join(faces)} face{'s' if len(faces) > 1 else ''}",
        ["n", "split (Hz)", "90 %", "slow axis (°)", "90 %", "with every order (Hz)", "axis (°)"],
        splits,
        "First order: harmonic 2n alone; every order: with the products of two harmonics."
        + (" One face: the other is assumed perfect." if len(faces) == 1 else ""),
    )
    places = [
        [
            name,
            str(face["points"]),
            str(face["outliers"]),
            f"{1e3 * face['noise_um']:.1f}",
            "" if face["tilt_deg"] is None else f"{face['tilt_deg']:.3f}",
            "" if face["offset_um"] is None else ", ".join(f"{x:.1f}" for x in face["offset_um"]),
        ]
        for name, face in faces.items()
    ]
    print_table("Faces", ["face", "points", "left out", "noise (nm)", "tilt (°)", "offset (µm)"], places)
    quantity = "wall" if len(faces) == 2 else next(iter(faces))
    rim = max(w.position for w in found.waves)
    waves = [
        [
            str(w.order),
            f"{1e6 * w.amplitude.value:.3f}",
            f"{1e6 * w.amplitude.low:.3f} … {1e6 * w.amplitude.high:.3f}",
            f"{degrees(w.azimuth):.1f}" if w.order else "",
        ]
        for w in found.waves
        if w.quantity == quantity and w.position == rim
    ]
    title = f"Circumferential harmonics of the {quantity} at position {rim:.3f} (µm)"
    print_table(title, ["wave", "amplitude", "90 %", "crest at (°)"], waves)


def _payload(found: "Scan", name: str, temperature: float, files: dict[str, str]) -> dict[str, Any]:
    import numpy as np

    def of(interval: "ScanInterval | None", factor: float) -> dict[str, float] | None:
        if interval is None:
            return None
        return {key: factor * getattr(interval, key) for key in ("value", "low", "high")}

    degrees = float(np.rad2deg(1.0))
    faces = {
        side: {
            "file": files[side],
            "points": face.points,
            "outliers": face.outliers,
            "noise_um": 1e6 * face.noise,
            "position": [face.low, face.high],
            "offset_um": None if face.motion is None else (1e6 * face.motion.offset).tolist(),
            "tilt_deg": None if face.motion is None else degrees * face.motion.tilt,
            "told": None if face.motion is None else list(face.motion.told),
        }
        for side, face in found.faces.items()
    }
    splits = [
        {
            "harmonic": one.split.harmonic,
            "frequency_Hz": one.split.frequency,
            "split_Hz": of(one.hertz, 1.0),
            "relative_ppm": of(one.relative, 1e6),
            "slow_axis_deg": of(one.slow_axis, degrees),
            "shift_ppm": 1e6 * one.split.shift,
            "every_order": {
                "split_Hz": one.whole.hertz,
                "slow_axis_deg": degrees * one.whole.slow_axis,
                "shift_ppm": 1e6 * one.whole.shift,
            },
        }
        for one in found.splits
    ]
    waves = [
        {
            "quantity": w.quantity,
            "order": w.order,
            "position": w.position,
            "amplitude_um": of(w.amplitude, 1e6),
            "azimuth_deg": degrees * w.azimuth,
        }
        for w in found.waves
    ]
    roundness = [
        {"face": r.face, "position": r.position, "peak_to_valley_um": 1e6 * r.peak_to_valley, "rms_um": 1e6 * r.rms}
        for r in found.roundness
    ]
    return {
        "schema": "hrg.scan/1",
        "card": name,
        "temperature_degC": temperature,
        "faces": faces,
        "splits": splits,
        "waves": waves,
        "roundness": roundness,
    }


def _save(path: str, instrument: "Instrument", found: "Scan") -> None:
    """The card with the faces as maps, whose tables are written first."""
    from pathlib import Path

    import numpy as np

    from studies.files.writing import write_text
    from studies.instrument.card import save_card

    target, maps = Path(path).resolve(), []
    for name in found.faces:
        x, theta, values = found.map_of(name, columns=72)
        lines = ["position," + ",".join(f"{angle:g}" for angle in np.rad2deg(theta))]
        lines += [
            f"{at:.9g}," + ",".join(f"{1e6 * cell:.7g}" for cell in row) for at, row in zip(x, values, strict=True)
        ]
        own = target.with_name(f"{target.stem}-{name}.csv")
        write_text(own, "\n".join(lines) + "\n")
        maps.append({"of": name, "file": str(own)})
    table = {**instrument.content.get("imperfection", {}), "map": maps}
    save_card(instrument.with_table("imperfection", table), path)


def _map_csv(found: "Scan") -> str:
    import numpy as np

    names = [*found.faces, *(("wall", "offset") if len(found.faces) == 2 else ())]
    maps = {name: found.map_of(name) for name in names}
    x, theta, _ = next(iter(maps.values()))
    lines = [",".join(["position", "azimuth_deg", *(f"{name}_um" for name in names)])]
    for i, at in enumerate(x):
        for j, angle in enumerate(theta):
            cells = (f"{1e6 * values[i, j]:.5f}" for _, _, values in maps.values())
            lines.append(f"{at:.6f},{np.rad2deg(angle):.3f}," + ",".join(cells))
    return "\n".join(lines) + "\n"
