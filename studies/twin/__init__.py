"""The virtual gyro outside: a card as C11 and as an FMU, with the numbers of `hrg simulate` and no Python inside."""
