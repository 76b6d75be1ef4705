"""The diagnosis on the independent generator: cases, scores, baselines beside it, the plan's promise, and the page."""
