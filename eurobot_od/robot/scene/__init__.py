"""Drawings of the playing field, in a file and on the page.

First, `recording` finds out what happened; then `scene` makes the drawings, each with its layer and its time. A file
(`sheet`) and the page (`panel`, `field.js`) place these drawings.
"""
