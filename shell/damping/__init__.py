"""Where a mode loses its energy: 1/Q as a sum of parts, each from the solved mode itself."""
