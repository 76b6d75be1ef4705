"""What a chamber can do: how fast it changes and how far it reaches; profiles in words that keep to it."""

from dataclasses import dataclass

from studies.errors import InputError

USUAL_RATE = 3.0
"""K/min of an ordinary temperature chamber."""


@dataclass(frozen=True)
class Chamber:
    """Largest rate, K/min, and range, °C; an open range is that of the campaign."""

    rate: float = USUAL_RATE
    low: float | None = None
    high: float | None = None

    def within(self, low: float, high: float) -> tuple[float, float]:
        """Return temperatures held to the range of the chamber, °C; a stated range is used in full."""
        return (low if self.low is None else self.low), (high if self.high is None else self.high)


def parse_chamber(words: str) -> Chamber:
    """Read "rate 3 range -40 85": K/min and °C, either part may be left out."""
    parts, rate, low, high = words.split(), USUAL_RATE, None, None
    try:
        while parts:
            match parts:
                case ["rate", value, *rest]:
                    rate, parts = float(value), rest
                case ["range", first, second, *rest]:
                    low, high, parts = float(first), float(second), rest
                case _:
                    raise ValueError
        if not rate > 0 or (low is not None and high is not None and not low < high):
            raise ValueError
    except ValueError:
        raise InputError(
            f'--chamber "{words}": state the rate (K/min) and the temperature range (°C), as in "rate 3 range -40 85", the lower one first.'
        ) from None
    return Chamber(rate, low, high)


def limited(words: str, rate: float) -> str:
    """Return a profile in words with ramps in the place of jumps, and no ramp faster than `rate`, K/min."""
    out: list[str] = []
    at: float | None = None
    for piece in words.split(" then "):
        match piece.split():
            case ["soak", level, hold]:
                at = _to(out, at, float(level), hold, rate)
            case ["step", first, last, hold]:
                at = _to(out, _to(out, at, float(first), "", rate), float(last), hold, rate)
            case ["staircase", first, last, step, hold]:
                begin, end, height = float(first), float(last), abs(float(step))
                count = round(abs(end - begin) / height)
                for k in range(count + 1):
                    at = _to(out, at, begin + (end - begin) * k / count, hold, rate)
            case ["ramp", first, last, speed]:
                at = _to(out, at, float(first), "", rate)
                out.append(f"ramp {first} {last} {min(float(speed), rate):g}")
                at = float(last)
            case ["cycle", begin, one, two, speed, hold, times]:
                at = _to(out, at, float(begin), "", rate)
                out.append(f"cycle {begin} {one} {two} {min(float(speed), rate):g} {hold} {times}")
                at = float(begin)
            case _:
                out.append(piece)
    return " then ".join(out)


def _to(out: list[str], at: float | None, level: float, hold: str, rate: float) -> float:
    """Go to a level and stay there, the way counted in the stay."""
    from thermal.profile import parse_profile

    minutes = parse_profile(f"soak {level:g} {hold}").end / 60.0 if hold else 0.0
    if at is not None and abs(level - at) > 1e-9:
        out.append(f"ramp {at:g} {level:g} {rate:g}")
        minutes -= abs(level - at) / rate
    if hold:
        out.append(f"soak {level:g} {max(1, round(minutes))}min")
    return level
