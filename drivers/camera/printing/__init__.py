"""Sheets of markers and boards to print, at true size."""
