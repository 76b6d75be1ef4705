"""Short scripts to start from, with `import hrg` only; each one runs as it is: `python -m studies.examples.design_code`."""
