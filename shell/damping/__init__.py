"""Loss of a mode: 1/Q as a sum of contributions, each computed from the solved mode."""
