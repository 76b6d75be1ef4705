"""Elastic constants, wall and stem from the frequencies of many modes (resonant ultrasound's question, for shells of revolution).

`readings` reads the table, `model` predicts ln f of modes and its derivatives by the card's values, `assignment` finds which
mode a reading is of, `invert` finds the values, how well they are known, and which mode to measure next.
"""
