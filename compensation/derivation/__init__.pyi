from .averaging import amplitude_rates, ellipse_rates
from .chain import steps
from .demodulated import amplitude_equations, measured_rate, poles, responses
from .design_code import emit_code
from .filters import derive_wiener_filter

__all__ = [
    "amplitude_equations",
    "amplitude_rates",
    "derive_wiener_filter",
    "ellipse_rates",
    "emit_code",
    "measured_rate",
    "poles",
    "responses",
    "steps",
]
