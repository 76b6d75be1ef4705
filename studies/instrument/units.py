"""Units that the names of keys carry: `mount_conductance_W_per_K` is in W/K."""

import re
from functools import lru_cache

SYMBOLS = {"um": "µm", "deg": "°", "degC": "°C", "day": "d", "rt": "√", "ohm": "Ω", "percent": "%"}
UNIT = re.compile(
    r"(10)?(per|rt|degC|deg|mrad|ppm|day|year|counts|[GMkmun]?(?:Pa|Hz|W|J|V|eV|N|g|K|s)|[cmunp]?m|pF|ohm|percent|h|1)([2-9])?"
)
RATES = {
    # words of a key: one unit, so that what follows belongs to it as a whole
    "deg per h": "°/h",
    "deg per s": "°/s",
    "K per s": "(K/s)",
    "K2 per s": "(K²/s)",
    "kg m3": "kg/m³",
}
EXPANSION = {"value": "1/K", "slope_per_K": "1/K²", "curvature_per_K2": "1/K³"}
"""Coefficients of the expansion's deviation, whose names say the powers of K beyond its own."""


def unit_of(name: str) -> str:
    """Return the unit that the last word of a dotted key carries, or "1"."""
    words = [word for word in name.split(".") if not word.isdigit()]
    if words[-2:-1] == ["expansion"]:
        return EXPANSION.get(words[-1], "1")
    return split_unit(words[-1])[1]


@lru_cache(maxsize=1024)
def split_unit(key: str) -> tuple[str, str]:
    """Split a key into its name and its unit ("1" where it carries none): `film_K_per_s` into ("film", "K/s")."""
    words = key.split("_")
    first = len(words)
    while first > 1 and UNIT.fullmatch(words[first - 1]):
        first -= 1
    while words[first : first + 1] == ["1"] and words[first + 1 : first + 2] not in ([], ["per"]):
        first += 1  # a wave number, as in cosine_1_um
    unit = " ".join(words[first:])
    for spelled, symbol in RATES.items():
        unit = re.sub(rf"\b{spelled}\b", symbol, unit)
    over, *under = (_spell(part) for part in re.split(r"per(?!cent)", unit))
    under = [f"({part})" if " " in part and not part.startswith("(") else part for part in under]
    return "_".join(words[:first]), "/".join([over or "1", *under])


def _spell(words: str) -> str:
    """Spell the words between two "per": powers raised, 10 K2 as (10 K)²."""
    found = []
    for word in words.split():
        matched = UNIT.fullmatch(word)
        if matched is None:
            found.append(word)
            continue
        ten, symbol, power = matched.groups()
        spelled = SYMBOLS.get(symbol, symbol)
        raised = "" if power is None else "²³⁴⁵⁶⁷⁸⁹"[int(power) - 2]
        found.append(f"(10 {spelled}){raised}" if ten and power else f"10 {spelled}" if ten else spelled + raised)
    return " ".join(found).replace("√ ", "√")
