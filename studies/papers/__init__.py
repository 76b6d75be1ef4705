"""The four source papers: their printed data, and what the workbench makes of it."""
