from .errors import InputError
from .instrument.card import Instrument, load_card, save_card
from .loss.model import LossModel, loss_model
from .models import read_model, write_model
from .record import Record, read_record, write_record
from .sweeps.run import run_study
from .workbench import calibrate, compare, diagnose, simulate

__version__: str
__all__ = [
    "InputError",
    "Instrument",
    "LossModel",
    "Record",
    "calibrate",
    "compare",
    "diagnose",
    "load_card",
    "loss_model",
    "read_model",
    "read_record",
    "run_study",
    "save_card",
    "simulate",
    "write_model",
    "write_record",
]
