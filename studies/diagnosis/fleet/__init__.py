"""Several devices of one design: `records` reads them, `investigation` diagnoses them together, `comparison` weighs what they share."""
