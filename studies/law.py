"""The frequency law of an instrument: what a simulation, a diagnosis, a study and a page take f(T) from."""

from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from shell.levels import Theory
    from studies.instrument.card import Instrument


def law_of(
    instrument: "Instrument",
    lowest: float = -inf,
    highest: float = inf,
    theory: "Theory" = "solid",
    harmonic: int = 2,
) -> "FrequencyLaw":
    """Build the frequency law of an instrument between two temperatures (K), within its material's range: over all of it unless given."""
    from shell.law import build_law, check_mount
    from studies.errors import naming

    T0, material, mount = instrument.reference_temperature, instrument.material, instrument.part("mount")
    if mount is not None:
        with naming(f"{instrument.path} [mount]"):
            check_mount(instrument.resonator, theory, harmonic)
            material.check(mount.joined_at)
    given = next((one for one in instrument.uncertain if one.name == "material.poisson_ratio"), None)
    if given is None:
        return build_law(instrument.resonator, material, T0, lowest, highest, theory, harmonic, mount)
    # A given Poisson's ratio that is uncertain: the law is solved for the ratios that it may have.
    ratio = replace(material.properties["poisson_ratio"], unsettled=(given.sd, 0.0, 0.0))
    open_one = replace(material, properties={**material.properties, "poisson_ratio": ratio})
    law = build_law(instrument.resonator, open_one, T0, lowest, highest, theory, harmonic, mount)
    return law.with_material(material)


def moved_law(law: "FrequencyLaw", instrument: "Instrument") -> "FrequencyLaw":
    """Return the law of an instrument whose material or mount has moved; solved anew where Poisson's ratio has left the law's."""
    from shell.errors import ShellError

    try:
        return replace(law.with_material(instrument.material), mount=instrument.part("mount"))
    except ShellError:
        return law_of(instrument, law.lowest, law.highest, law.theory, law.harmonic)
