"""Ring-downs: frequencies, Q, axes of stiffness and of damping from the free decay of a resonator."""
