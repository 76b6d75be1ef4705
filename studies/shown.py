"""How a result shows itself in an interactive session: one short line, a table, and both in a notebook."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pandas import DataFrame


class Shown:
    """Gives a class with a short `__repr__` and `to_frame` its look in a notebook."""

    def to_frame(self) -> "DataFrame":
        """Return what the result holds as a table."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        from html import escape

        return f"<p>{escape(repr(self))}</p>{self.to_frame().to_html(max_rows=30, float_format='{:.6g}'.format)}"
