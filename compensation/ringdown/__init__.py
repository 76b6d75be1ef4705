"""Ring-downs: frequencies, Q, axes of elasticity and of damping from the free decay of a resonator."""
