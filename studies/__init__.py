"""Where mechanics, heat and compensation meet; each name of `__init__.pyi` is imported when it is first used."""

__version__ = "0.1.0"


def __getattr__(name: str) -> object:
    """Attach the stub when the first name is asked for: the command line passes here before it can heed Ctrl-C."""
    import lazy_loader

    find, list_names, names = lazy_loader.attach_stub(__name__, __file__)
    globals().update(__getattr__=find, __dir__=list_names, __all__=names)
    return names if name == "__all__" else find(name)


def __dir__() -> list[str]:
    return [*globals(), *__getattr__("__all__")]  # type: ignore[misc]
