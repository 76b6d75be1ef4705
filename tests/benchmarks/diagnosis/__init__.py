"""Campaigns with a card, marks of recorded answers, and what an ideal detector would see."""
