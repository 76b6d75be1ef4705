"""Lumped thermal networks: chamber profile to temperatures; each name of `__init__.pyi` is imported when first used."""

import lazy_loader

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
