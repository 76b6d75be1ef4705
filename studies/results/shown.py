"""How a result shows itself in an interactive session: one short line, a table, and both in a notebook."""

from importlib import import_module
from typing import TYPE_CHECKING, ClassVar

from studies.results import Drawing

if TYPE_CHECKING:
    from pandas import DataFrame


class Shown:
    """Gives a class with a short `__repr__` and `to_frame` its look in a notebook, and its picture."""

    drawn_by: ClassVar[str] = ""  # "module:function" of the picture: results do not import the pages, which import them

    def to_frame(self) -> "DataFrame":
        """Return what the result holds as a table."""
        raise NotImplementedError

    def plot(self) -> Drawing:
        """Return the picture of the result (matplotlib)."""
        module, _, name = self.drawn_by.partition(":")
        if not module:
            raise NotImplementedError
        return getattr(import_module(module), name)(self)

    def _repr_html_(self) -> str:
        from html import escape

        return f"<p>{escape(repr(self))}</p>{self.to_frame().to_html(max_rows=30, float_format='{:.6g}'.format)}"
