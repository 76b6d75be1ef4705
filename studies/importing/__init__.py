"""Laboratory files as they really are, brought into the record format by a small map that states every change."""
