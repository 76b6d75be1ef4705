from .bias import prepare_run
from .bias_selection import fit_bias, score_held_out
from .cross_damping import RestRun, fit_cross_damping
from .errors import CompensationError
from .frequency import FrequencyFit, fit_frequency
from .kalman import model_gyro, run_filter
from .stability import allan_deviation, fit_noise
from .transfer import TransferFunction
from .wiener import design_wiener_filter

__version__: str
__all__ = [
    "CompensationError",
    "FrequencyFit",
    "RestRun",
    "TransferFunction",
    "allan_deviation",
    "design_wiener_filter",
    "fit_bias",
    "fit_cross_damping",
    "fit_frequency",
    "fit_noise",
    "model_gyro",
    "prepare_run",
    "run_filter",
    "score_held_out",
]
