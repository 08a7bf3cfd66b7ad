"""A network's messages and devices in the formats of other tools and languages: DBC, C, Lua, XDD, Markdown, HTML.

Names and texts of a file are never written unchanged: `description` makes identifiers from names, and every text is
escaped for its format.
"""
