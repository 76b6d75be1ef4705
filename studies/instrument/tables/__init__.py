"""Tables of a card: one file a table, or a few keys of one, each with a `TABLE` (`studies.instrument.registry.CardTable`)."""
