"""Losses of an instrument: budget by causes, films, account of a stated Q, and damping over temperature."""
