from .curves import Arc, Line
from .damping.budget import loss_budget
from .elastic import Elastic
from .errors import ShellError
from .imperfection.split import find_split
from .law import FrequencyLaw, build_law
from .material import Material
from .materials import find_material
from .meridian import bell, cylinder, hemisphere, meridian
from .modes import Mode, solve_modes
from .resonator import Resonator, Stem

__version__: str
__all__ = [
    "Arc",
    "Elastic",
    "FrequencyLaw",
    "Line",
    "Material",
    "Mode",
    "Resonator",
    "ShellError",
    "Stem",
    "bell",
    "build_law",
    "cylinder",
    "find_material",
    "find_split",
    "hemisphere",
    "loss_budget",
    "meridian",
    "solve_modes",
]
