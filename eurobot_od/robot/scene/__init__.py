"""The playing field as it is drawn: in a file, and on the page.

What happened (`recording`) is worked out first, then what there is to draw, each thing with its layer and its time
(`scene`). A file (`sheet`) and the page (`panel`, `field.js`) only put those drawings in their place.
"""
