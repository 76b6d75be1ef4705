from .errors import ThermalError
from .lag import lag
from .network import Boundary, Conductor, Network, Node, Radiator, Source, assemble
from .profile import Profile, parse_profile
from .relaxation import find_relaxation
from .steady import find_steady_state
from .sweeping import sweep

__version__: str
__all__ = [
    "Boundary",
    "Conductor",
    "Network",
    "Node",
    "Profile",
    "Radiator",
    "Source",
    "ThermalError",
    "assemble",
    "find_relaxation",
    "find_steady_state",
    "lag",
    "parse_profile",
    "sweep",
]
