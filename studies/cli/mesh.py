"""`hrg mesh`: the solid as a quadratic mesh for another finite-element program."""

from dataclasses import replace
from typing import Annotated, cast

from cyclopts import Parameter

from shell.constants import zero_Celsius
from shell.imperfection.surface import depart_points
from shell.inertia import weigh
from shell.volume import AROUND, LAYERS, MOST_ALONG, VolumeKind, build_volume, encode_volume
from studies.cli.arguments import POSITIVE, Card, Out, Temperature, ending_of, numbers, open_resonator
from studies.cli.output import answers
from studies.errors import InputError, naming
from studies.files.writing import written_whole
from studies.resonator.splitting import solved_pair
from studies.results import Result, row_of

KINDS = (".vtu", ".msh", ".inp")


def _between(low: int, high: int) -> Parameter:
    return numbers(lambda one: low <= one <= high, f"{low} to {high}")


@answers("hrg.mesh/1")
def mesh(
    card: Card,
    *,
    out: Out,
    layers: Annotated[int, _between(*LAYERS)] = 2,
    around: Annotated[int, _between(*AROUND)] = 48,
    spacing_mm: Annotated[float | None, POSITIVE, Parameter(show_default=False)] = None,
    complete: bool = False,
    temperature: Temperature = None,
) -> Result:
    """Mesh the solid for a finite-element program: shell, roots, fillets, corners and stem, with matching nodes.

    The elements are quadratic hexahedra, and wedges on the axis; all nodes lie on the true surfaces. The extension of
    --out selects the format: .vtu for VTK and ParaView, .msh for Gmsh (2.2), .inp for Abaqus and CalculiX. Lengths are in m.
    The supported nodes form the group or set "held" (in .vtu: the point data "held"). The mesh includes the departures of faces
    and rim in the card's [imperfection], but not its masses and material variations. With the default mesh of free-dome, CalculiX
    gives n = 2 0.5 % too high; with --around 72 --spacing-mm 1.5, 0.2 %.

    Args:
        layers: Elements through the thickness.
        around: Elements around the axis.
        spacing_mm: Longest element along the meridian; a sixth of the radius unless given.
        complete: Add nodes at the centres of faces and elements: 27 and 18 for each element instead of 20 and 15.
    """
    kind = ending_of(out, KINDS)
    if complete and kind == ".inp":
        raise InputError("--complete: an .inp file has elements of 20 and 15 nodes only; leave it out, or take .msh.")
    instrument, T, resonator, elastic = open_resonator(card, temperature)
    if spacing_mm is not None and 1e-3 * spacing_mm < (least := resonator.length / MOST_ALONG):
        raise InputError(f"--spacing-mm {spacing_mm:g}: must be at least {1e3 * least:.4g}, of this meridian a {MOST_ALONG}th.")  # fmt: skip
    with naming(instrument.path):
        found = build_volume(resonator, layers, around, None if spacing_mm is None else 1e-3 * spacing_mm)
    found = found if complete else found.serendipity()
    fields = instrument.part("imperfection").fields
    if fields is not None:
        with naming(f"{instrument.path} [imperfection]"):
            shape = fields.faded(solved_pair(resonator, elastic, 2).fade)
            found = replace(found, nodes=depart_points(found.nodes, resonator, shape))
    data = encode_volume(found, cast("VolumeKind", kind[1:]))
    with written_whole(out) as file:
        file.write(data)
    exact = weigh(resonator, elastic.rho)
    payload = {
        "card": instrument.name,
        "temperature_degC": T - zero_Celsius,
        "file": out,
        "bytes": len(data),
        **{name: len(getattr(found, name)) for name in ("nodes", "hexahedra", "wedges")},
        "held_nodes": len(found.held),
        **row_of(exact, volume_mm3=("volume", 1e9), mass_g=("mass", 1e3)),
    }
    said = (
        f"{out}: {len(found.nodes):,} nodes, {len(found.hexahedra):,} hexahedra, {len(found.wedges):,} wedges,"
        f" {len(found.held):,} nodes held. The solid has {1e9 * exact.volume:.6g} mm³ and {1e3 * exact.mass:.5g} g."
    )
    if fields is not None:
        said += " The mesh includes the geometric departures of the card's [imperfection], but not its masses or material variations."
    return Result(payload, f"Mesh of {instrument.name}", f"Quadratic elements at {T - zero_Celsius:g} °C.", [said])
