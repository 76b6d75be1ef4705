"""Symbolic derivation of the averaged dynamics of a Coriolis vibratory gyro from its two-dimensional oscillator.

`oscillator` the equations of motion of the two patterns · `averaging` amplitudes that vary slowly, and from them
amplitude, quadrature, precession and phase (Lynch's form) · `demodulated` the CVG paper's amplitude equations (7)–(25),
and that both are one · `chain` all of them in order · `design_code` the averaged equations as Python or C. Each step is
a function that returns SymPy expressions and remembers them. The numbers without SymPy are in `compensation.wave`.
The names of `__init__.pyi` can be taken from here; each is imported when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
