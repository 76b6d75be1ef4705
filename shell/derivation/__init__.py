"""Symbolic derivation of the HRG paper's equations (1)–(15), every step an importable result.

`displacements` (1), (2) · `strains` (6), (8) · `energies` (3)–(5), (7) · `inextensional` (9)–(11) ·
`frequency` (12)–(14) · `temperature` (15) · `coriolis` the Bryan factor · `chain` all of them in order ·
`design_code` the formulas as code · `bell` the BVG paper's equations (1)–(6), (16)–(22), `bell_dynamics` its (7)–(15), `bell_chain` all in order.
Each step is a function that returns a SymPy expression and remembers it. The numbers without SymPy are in `shell.rayleigh` and `shell.bell_theory`.
The names of `__init__.pyi` can be taken from here; each is imported when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
