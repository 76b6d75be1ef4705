"""Short scripts to start from; each one runs as it is: `python -m studies.examples.design_code`."""
