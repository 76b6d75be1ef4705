"""The page of a scan: unwrapped maps, splits, waves around, roundness."""

from typing import TYPE_CHECKING

import numpy as np

from studies.reports.digits import to_interval
from studies.reports.page import Chapter, Facts, Picture, Table, Text, draw, render_page
from studies.reports.style import BLUE, ORANGE, figure

if TYPE_CHECKING:
    from studies.scan import Scan, ScanInterval


LEAD = "Measured faces, aligned with the card's resonator and fitted with circumferential harmonics, and the frequency splits that they cause."


def write_scan_page(path: str, scan: "Scan", card: str, files: dict[str, str]) -> None:
    """Write the page, whole or not at all."""
    from studies.files.writing import write_text

    write_text(path, render_page(f"Scan of {card}", LEAD, _chapters(scan, files)))


def _chapters(scan: "Scan", files: dict[str, str]) -> list[Chapter]:
    main = min(scan.splits, key=lambda one: abs(one.split.harmonic - 2))
    axis = "undetermined" if main.slow_axis is None else f"{np.rad2deg(main.slow_axis.value):.1f}°"
    split, low, high = _millihertz(main.hertz)
    facts = Facts(
        [
            (f"Split of n = {main.split.harmonic}", f"{split} mHz", f"90 %: {low} … {high} mHz"),
            ("Slow axis", axis, "an antinode of the slower mode: remove mass there"),
            ("Noise of a point", ", ".join(f"{1e9 * f.noise:.0f} nm" for f in scan.faces.values()), " and ".join(scan.faces)),
        ]
    )  # fmt: skip
    one_face = Text(
        "One face was measured; the other is assumed perfect, so the wall is this face's departure.", "warning"
    )
    return [
        Chapter("Result", [facts, *([one_face] if len(scan.faces) == 1 else []), _splits(scan)]),
        Chapter("Maps", [_maps(scan)]),
        Chapter("Circumferential harmonics", [_waves(scan)]),
        Chapter("Roundness", [_roundness(scan)]),
        Chapter("Faces", [_faces(scan, files)]),
    ]


def _splits(scan: "Scan") -> Table:
    rows = []
    for one in scan.splits:
        axis = one.slow_axis
        split, low, high = _millihertz(one.hertz)
        rows.append([
            str(one.split.harmonic), f"{one.split.frequency:.3f}", split, f"{low} … {high}",
            "undetermined" if axis is None else f"{np.rad2deg(axis.value):.2f}",
            "" if axis is None else f"{np.rad2deg(axis.low):.2f} … {np.rad2deg(axis.high):.2f}",
            to_interval(1e3 * one.whole.hertz, 1e3 * one.hertz.low, 1e3 * one.hertz.high)[0],
            f"{np.rad2deg(one.whole.slow_axis):.2f}",
        ])  # fmt: skip
    columns = ["n", "f (Hz)", "Split (mHz)", "90 %", "Slow axis (°)", "90 %", "Every order (mHz)", "Axis (°)"]
    return Table(
        "Splits that the faces cause",
        columns,
        rows,
        "First order: harmonic 2n alone; every order: with the products of two harmonics.",
    )


def _millihertz(split: "ScanInterval") -> list[str]:
    return to_interval(1e3 * split.value, 1e3 * split.low, 1e3 * split.high)


def _maps(scan: "Scan") -> Picture:
    names = ["wall", "offset"] if len(scan.faces) == 2 else list(scan.faces)
    with figure(len(names), 1, 2.5 * len(names), squeeze=False) as (made, axes):
        for ax, name in zip(axes[:, 0], names, strict=True):
            x, theta, values = scan.map_of(name)
            shown = 1e6 * (values - values.mean(axis=1, keepdims=True))
            most = max(float(abs(shown).max()), 1e-6)
            image = ax.pcolormesh(
                np.rad2deg(theta), x, shown, cmap="RdBu_r", vmin=-most, vmax=most, shading="nearest", rasterized=True
            )
            made.colorbar(image, ax=ax, label="µm")
            ax.set(title={"wall": "Wall, mean of each circle removed", "offset": "Middle surface"}.get(name, f"{name} face"),
                   xlabel="azimuth (°)", ylabel="position (1: rim)", xticks=range(0, 361, 45))  # fmt: skip
            ax.grid(False)
        return draw(
            made,
            "The fitted departures, unwrapped.",
            "maps of wall thickness and middle surface over azimuth and meridian",
        )


def _waves(scan: "Scan") -> Picture:
    quantity = "wall" if len(scan.faces) == 2 else next(iter(scan.faces))
    rim = max(w.position for w in scan.waves)
    with figure(1, 1, 3.2) as (made, ax):
        for q, colour, shift in ((quantity, BLUE, -0.15), ("offset", ORANGE, 0.15)):
            mine = [w for w in scan.waves if w.quantity == q and w.position == rim and w.order > 0]
            if not mine:
                continue
            value = np.array([1e6 * w.amplitude.value for w in mine])
            spread = np.array(
                [
                    [1e6 * (w.amplitude.value - w.amplitude.low), 1e6 * (w.amplitude.high - w.amplitude.value)]
                    for w in mine
                ]
            )
            order = np.array([w.order for w in mine])
            ax.bar(order + shift, value, 0.28, color=colour, label=q)
            ax.errorbar(order + shift, value, np.maximum(spread.T, 0), fmt="none", ecolor="black", capsize=2)
        ax.set(xlabel="circumferential harmonic", ylabel="amplitude at the rim (µm)", yscale="log")
        ax.legend()
        caption = "Circumferential harmonics at the rim with 90 % intervals; the split of n comes from harmonic 2n."
        return draw(made, caption, "bars of harmonic amplitudes")


def _roundness(scan: "Scan") -> Table:
    rows = [
        [r.face, f"{r.position:.3f}", f"{1e6 * r.peak_to_valley:.3f}", f"{1e6 * r.rms:.3f}"] for r in scan.roundness
    ]
    note = "From harmonic 2 of the fit on; harmonic 1 is the eccentricity of the circle."
    return Table("Roundness of circles", ["Face", "Position", "Peak to valley (µm)", "Rms (µm)"], rows, note)


def _faces(scan: "Scan", files: dict[str, str]) -> Table:
    rows = []
    for name, face in scan.faces.items():
        motion = face.motion
        rows.append([
            name, files[name], str(face.points), str(face.outliers), f"{1e9 * face.noise:.1f}", f"{face.low:.3f} … {face.high:.3f}",
            "" if motion is None else ", ".join(f"{1e6 * x:.1f}" for x in motion.offset),
            "" if motion is None else f"{np.rad2deg(motion.tilt):.3f}",
        ])  # fmt: skip
    return Table(
        "What was read",
        ["Face", "File", "Points", "Left out", "Noise (nm)", "Positions", "Offset (µm)", "Tilt (°)"],
        rows,
    )
