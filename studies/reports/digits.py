"""Digits of numbers for people: as many as an error or an interval supports, without exponents where they can be avoided."""

import math

SMALLEST, LARGEST = 1e-4, 1e6  # between these a number is written without an exponent


def plain(value: float | None, digits: int = 3) -> str:
    """Return a number to so many significant digits; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "—"
    if value == 0.0:
        return "0"
    size = abs(float(f"{value:.{digits - 1}e}"))
    if not SMALLEST <= size < LARGEST:
        return short_exponent(f"{value:.{digits - 1}e}")
    text = f"{value:.{max(digits - 1 - math.floor(math.log10(size)), 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def short_exponent(text: str) -> str:
    """Return 7.28e6 for 7.28e+06."""
    return text.replace("e+0", "e").replace("e+", "e").replace("e-0", "e-")


def to_error(value: float, error: float) -> tuple[str, str]:
    """Return a value and its standard error, both to the second digit of the error."""
    if not 0.0 < error < math.inf:
        return plain(value, 6), plain(error, 2)
    written, _, below = to_interval(value, 0.0, error)
    return written, below


def to_numerical_error(value: float, error: float, most: int = 12) -> str:
    """Return a value to the second digit of its numerical error, with `most` decimals at the most."""
    digits = min(most, max(0, 1 - math.floor(math.log10(error)))) if error > 0.0 else most
    return f"{value:.{digits}f}"


def to_interval(value: float, low: float, high: float) -> list[str]:
    """Return a value and the ends of its interval to the second digit of the interval's width."""
    width = high - low
    if not 0.0 < width < math.inf:
        return [plain(x, 6) for x in (value, low, high)]
    last = math.floor(math.log10(float(f"{width:.1e}"))) - 1  # power of ten of the last digit
    size = max(map(abs, (value, low, high)))
    if SMALLEST <= size < LARGEST or SMALLEST <= width < LARGEST:
        return [f"{round(x, -last) + 0.0:.{max(-last, 0)}f}" for x in (value, low, high)]  # no -0

    def write(x: float) -> str:
        digits = math.floor(math.log10(abs(x))) - last if x else -1
        return short_exponent(f"{x:.{digits}e}") if digits >= 0 else "0"

    return [write(x) for x in (value, low, high)]


def raised(power: int) -> str:
    """Return a whole power as a superscript."""
    return str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def lowered(index: int) -> str:
    """Return a whole index as a subscript."""
    return str(index).translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))
