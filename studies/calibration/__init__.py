"""Most probable values of a card, given what is known of them and records of the device."""
