"""The virtual gyro: a card and a chamber profile become a record."""
