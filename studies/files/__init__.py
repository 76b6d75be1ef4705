"""Files of users: read with errors that name line and key, written whole or not at all."""
