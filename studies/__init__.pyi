from .errors import InputError
from .instrument.card import Instrument, load_card, save_card
from .loss.model import LossModel, loss_model
from .models import ModelSource, compensate, emit_c, read_model, write_model
from .models.kinds.frequency import save_frequency
from .record import Record, read_record, write_record
from .resonator.law import law_of
from .resonator.splitting import reference_split
from .sweeps.run import run_study
from .sweeps.tolerance import find_yield
from .workbench import calibrate, compare, diagnose, simulate

__version__: str
__all__ = [
    "InputError",
    "Instrument",
    "LossModel",
    "ModelSource",
    "Record",
    "calibrate",
    "compare",
    "compensate",
    "diagnose",
    "emit_c",
    "find_yield",
    "law_of",
    "load_card",
    "loss_model",
    "read_model",
    "read_record",
    "reference_split",
    "run_study",
    "save_card",
    "save_frequency",
    "simulate",
    "write_model",
    "write_record",
]
