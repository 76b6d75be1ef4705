"""Columns as a laboratory's file has them."""


def write_columns(path, columns, comments=()):
    """Write columns by name below comments, twelve digits and nothing for NaN; return the path as text."""
    lines = [*(f"# {one}" for one in comments), ",".join(columns)]
    rows = zip(*columns.values(), strict=True)
    lines += [",".join("" if value != value else f"{value:.12g}" for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return str(path)
