"""What a diagnosis says (`response`, `checks`, `verdict`), and steady-state tables (`table`); records: `studies.inference`."""
