"""Helpers that know nothing of CAN: amounts, durations, files, harmless text, YAML with places, SVG."""
